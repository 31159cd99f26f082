"""The other way: OpenModelica (``omc`` on the PATH) builds an FMU, which runs like any FMU.

For what the stepper here refuses: events, index reduction, external functions, the standard
library.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from evertwin.errors import ModelError, UsageError
from evertwin.models.fmu import Fmu, fmu
from evertwin.models.modelica.model import LIBRARY, Modelica

_NAME = re.compile(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*)*$")


def modelica(
    model: str | None = None, file: str = "", libraries: Sequence[str] = (), via: str = "rumoca",
    **options: Any,
) -> Modelica | Fmu:  # fmt: skip
    """What a twin file's ``kind = "modelica"`` means.

    Args:
        model: name of the model.
        file: the ``.mo`` file.
        libraries: further libraries that it uses.
        via: ``rumoca`` or ``openmodelica``.
        options: of `Modelica`, or of an FMU (`evertwin.models.fmu.Options`).

    Raises:
        UsageError: an unknown way, or no ``omc`` on the PATH.
        ModelError: the model is refused.
    """
    if via == "rumoca":
        return Modelica(model, file, libraries, **options)
    if via != "openmodelica":
        raise UsageError(f"modelica: via: expected rumoca or openmodelica, got {via!r}")
    seconds = float(options.pop("limit", 600.0))
    return fmu(exported(file or str(LIBRARY), model or "", libraries, seconds), **options)


def exported(file: str, model: str, libraries: Sequence[str] = (), limit: float = 600.0) -> Path:
    """The FMU that OpenModelica makes of a model, in a folder of its own.

    Args:
        limit: longest time that it may take [s].

    Raises:
        UsageError: there is no ``omc`` on the PATH, or no plain name of a model.
        ModelError: it takes too long, or gives no FMU; with what it said.
    """
    compiler = shutil.which("omc")
    if compiler is None:
        raise UsageError("modelica: no 'omc' on the PATH: install OpenModelica, or leave out via")
    if not _NAME.match(model):
        raise UsageError(f"modelica: expected the name of a model (model = ...), got {model!r}")
    folder = Path(tempfile.mkdtemp(prefix="evertwin-omc-"))
    script = folder / "export.mos"
    script.write_text(_script(file, model, libraries))
    try:
        done = subprocess.run(
            [compiler, str(script)], cwd=folder, capture_output=True, text=True, timeout=limit,
            check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        raise ModelError(f"{file}: omc took longer than {limit:g} s and was ended") from error
    target = folder / f"{model}.fmu"
    if not target.is_file():
        said = " ".join((done.stdout + done.stderr).split())[-500:]
        raise ModelError(f"{file}: omc gave no FMU of {model}: {said}")
    return target


def _script(file: str, model: str, libraries: Sequence[str]) -> str:
    """What omc is told; names of files are quoted as its language wants them."""
    files = [*libraries, *([] if file == str(LIBRARY) else [str(LIBRARY)]), file]
    loads = [f"loadFile({json.dumps(str(Path(f).resolve()))}); getErrorString();" for f in files]
    build = f'buildModelFMU({model}, version="2.0", fmuType="me_cs"); getErrorString();'
    return "\n".join(["loadModel(Modelica);", *loads, build, ""])
