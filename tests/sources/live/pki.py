"""Certificates for a test: an authority, and what it signs."""

from __future__ import annotations

import ipaddress
from datetime import UTC, datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

PEM = serialization.Encoding.PEM
DAYS = (-1, 1)
"""From when to when a certificate is valid, from today."""


class Authority:
    """Signs; its own certificate lies in ``file``."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name = folder, x509.Name([_common(name)])
        self.key = ec.generate_private_key(ec.SECP256R1())
        made = _builder(self.name, self.key.public_key(), DAYS).issuer_name(self.name)
        made = made.add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        made = made.add_extension(x509.KeyUsage(*(k == 5 for k in range(9))), critical=True)
        self.file = folder / f"{name}.pem"
        self.file.write_bytes(made.sign(self.key, hashes.SHA256()).public_bytes(PEM))

    def sign(self, name: str, host: str = "127.0.0.1", days: tuple[int, int] = DAYS) -> Path:
        """A certificate for a host; its key lies beside it, as .key."""
        key = ec.generate_private_key(ec.SECP256R1())
        whose = x509.SubjectAlternativeName([x509.IPAddress(ipaddress.ip_address(host))])
        made = _builder(x509.Name([_common(name)]), key.public_key(), days)
        made = made.issuer_name(self.name).add_extension(whose, critical=False)
        found = self.folder / f"{name}.pem"
        found.write_bytes(made.sign(self.key, hashes.SHA256()).public_bytes(PEM))
        found.with_suffix(".key").write_bytes(_private(key))
        return found


def own(folder: Path, name: str, days: tuple[int, int] = DAYS) -> tuple[Path, Path]:
    """A certificate that signs itself, as OPC UA has them, and its key."""
    key = rsa.generate_private_key(65537, 2048)
    subject = x509.Name([_common(name)])
    uri = x509.SubjectAlternativeName([x509.UniformResourceIdentifier(f"urn:{name}")])
    made = _builder(subject, key.public_key(), days).issuer_name(subject)
    made = made.add_extension(uri, critical=False)
    found = folder / f"{name}.der"
    signed = made.sign(key, hashes.SHA256())
    found.write_bytes(signed.public_bytes(serialization.Encoding.DER))
    found.with_suffix(".pem").write_bytes(_private(key))
    return found, found.with_suffix(".pem")


def _common(name: str) -> x509.NameAttribute:
    return x509.NameAttribute(x509.NameOID.COMMON_NAME, name)


def _builder(subject: x509.Name, key: object, days: tuple[int, int]) -> x509.CertificateBuilder:
    first, last = (datetime.now(UTC) + timedelta(days=one) for one in days)
    made = x509.CertificateBuilder().subject_name(subject).public_key(key)  # type: ignore[arg-type]
    made = made.serial_number(x509.random_serial_number())
    return made.not_valid_before(first).not_valid_after(last)


def _private(key: ec.EllipticCurvePrivateKey | rsa.RSAPrivateKey) -> bytes:
    kind, none = serialization.PrivateFormat.PKCS8, serialization.NoEncryption()
    return key.private_bytes(PEM, kind, none)
