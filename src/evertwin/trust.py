"""Whom one speaks with: certificates in a folder are those that are trusted, none is on its own
word; and TLS to a broker that says why it failed.

>>> import tempfile
>>> trusted(Path(tempfile.mkdtemp()))
()
"""

from __future__ import annotations

import importlib
import ssl
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal, TypeAlias

from evertwin.errors import UsageError, needs, reason_of

File: TypeAlias = "str | Path"
Policy: TypeAlias = Literal["none", "Basic256Sha256", "Aes128Sha256RsaOaep", "Aes256Sha256RsaPss"]
"""How sessions of OPC UA are signed and encrypted."""


def check_secured(security: Policy, **files: str | None) -> None:
    """Is what a security policy needs named?

    Raises:
        UsageError: a file lacks.
    """
    lacking = [name for name, file in files.items() if not file]
    if security != "none" and lacking:
        raise UsageError(
            f"security = {security!r}: needs {', '.join(lacking)}: the own certificate and key, "
            "and a folder with the certificates that are trusted"
        )


def trusted(folder: Path) -> tuple[bytes, ...]:
    """The certificates (.der or .pem) that lie in a folder, as DER; a file that holds none is left
    out. It is read with each call: what is put there or taken away counts at once."""
    files = sorted(folder.iterdir()) if folder.is_dir() else ()
    encoding = _loaded("hazmat.primitives.serialization").Encoding.DER
    found = (_read(path.read_bytes()) for path in files if path.is_file())
    return tuple(one.public_bytes(encoding) for one in found if one is not None)


def why_not(certificate: bytes, folder: Path) -> str:
    """Why a certificate (DER) is not believed; empty: it lies in the folder and is valid now."""
    if certificate not in trusted(folder):
        return f"its certificate is not in {folder}: compare it on the machine, then put it there"
    made, now = _read(certificate), datetime.now(UTC)
    if made is None or not made.not_valid_before_utc <= now <= made.not_valid_after_utc:
        return "its certificate is not valid now: give it a new one, and trust that"
    return ""


def _read(content: bytes) -> Any:
    """A certificate; None where the content is none."""
    x509 = _loaded("x509")
    pem = content.lstrip().startswith(b"-----BEGIN")
    try:
        return (x509.load_pem_x509_certificate if pem else x509.load_der_x509_certificate)(content)
    except ValueError:
        return None


def _loaded(name: str) -> Any:
    with needs("live", "cryptography"):
        return importlib.import_module(f"cryptography.{name}")


class Tls:
    """TLS of a client: the other side is checked, its name too.

    >>> Tls().context.check_hostname, Tls().why
    (True, '')
    """

    def __init__(
        self, ca: File | None = None, certificate: File | None = None, key: File | None = None
    ) -> None:
        """
        Args:
            ca: file with the certificates that are trusted; None: those of the system.
            certificate: this end's own, with its key in the same file or in ``key``.

        Raises:
            OSError: a file cannot be read.
        """
        self.context = ssl.create_default_context(cafile=ca)
        if certificate is not None:
            self.context.load_cert_chain(certificate, key)
        self.why = ""
        """Why the other side ended it, when it did so after the handshake."""
        tls = self

        class Line(ssl.SSLSocket):
            def do_handshake(self, block: bool = False) -> None:
                try:
                    super().do_handshake(block)
                except OSError:
                    self.close()  # paho would leave it open
                    raise

            def recv(self, buflen: int = 1024, flags: int = 0) -> bytes:
                try:
                    return super().recv(buflen, flags)
                except (ssl.SSLWantReadError, ssl.SSLWantWriteError):
                    raise
                except ssl.SSLError as error:
                    tls.why = reason_of(error)
                    raise

        self.context.sslsocket_class = Line
