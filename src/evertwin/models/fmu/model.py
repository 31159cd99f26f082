"""A Functional Mock-up Unit (FMI 2.0 or 3.0) as a Model.

    pump = fmu("pump.fmu", inputs=["speed"], outputs=["pressure"], parameters=["leak"])

In a twin file::

    [model]
    kind = "fmu"
    options = { file = "pump.fmu", parameters = ["leak"], step = 0.001 }

The FMU lives in a child process with limits (`evertwin.models.fmu.worker`), which runs whole blocks
with all restarts inside them. What it must offer for that is said in `evertwin.models.fmu.binding`.
Needs the extra ``fmi`` (FMPy).
"""

from __future__ import annotations

import importlib.util
import logging
import platform
import sys
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from evertwin.errors import MissingExtra, ModelError
from evertwin.models.fmu import slots as at
from evertwin.models.fmu.binding import LARGEST, Binding, bind
from evertwin.models.fmu.description import SIZE, Description, parse_description
from evertwin.models.fmu.faults import Fault
from evertwin.models.fmu.guard import opened
from evertwin.models.fmu.options import Options
from evertwin.models.fmu.worker import Worker
from evertwin.models.functions.function import adopted, python_kernel
from evertwin.models.kernels.kernel import Kernel, Restart
from evertwin.models.kernels.rollout import roll, sized
from evertwin.models.one_line import one_line
from evertwin.models.parameters import Parameters
from evertwin.signals.channels import Layout, position
from evertwin.types import Float64, Inputs, Intervals, ParameterVector, Rollout, StateVector

log = logging.getLogger("evertwin")
_SYSTEMS = {
    "linux": ("linux64", "linux", ".so"),
    "darwin": ("darwin64", "darwin", ".dylib"),
    "win32": ("win64", "windows", ".dll"),
}
_RATIO = 1e-3
"""A trial that starts in the middle may differ by this much of its outputs."""


def fmu(file: str | Path, **options: Any) -> Fmu:
    """The FMU in ``file``; see `Options` for all that may be said.

    Raises:
        ModelError: the file is refused, does not load, or cannot serve a twin.
        UsageError: an option that cannot be meant.
        MissingExtra: FMPy is not installed.
    """
    for name in options:
        position(Options.__match_args__, name, "option")
    return Fmu.of(file, Options(**options))


@dataclass(frozen=True)
class Fmu:
    """An FMU as a Model; `fmu` or `Fmu.of` build it.

    >>> Fmu.__name__      # see docs/how-to/fmu.md for one that runs
    'Fmu'
    """

    __repr__ = one_line

    binding: Binding
    inputs: Layout
    outputs: Layout
    states: Layout
    parameters: Parameters
    worker: Worker

    @classmethod
    def of(cls, file: str | Path, options: Options | None = None) -> Fmu:
        """Checks, loads and tries an FMU.

        Raises:
            ModelError: the file is refused, does not load, or cannot serve a twin.
            MissingExtra: FMPy is not installed.
        """
        path, options = Path(file).absolute(), options or Options()
        if importlib.util.find_spec("fmpy") is None:
            raise MissingExtra.of("fmpy", "fmi")
        description, names = _look(path, options)
        binding = bind(description, options, path.name)
        folder = _binary(binding, names)
        worker = Worker(path, binding.plan(folder), options)
        try:
            saved = worker.load()
            if saved > LARGEST:
                raise ModelError(
                    f"{path.name}: saves {saved} bytes of state, expected at most {LARGEST}: name "
                    "states that take start values, or use model exchange"
                )
            worker.attach(binding.page(saved))
            model = cls(
                binding, binding.inputs.layout, binding.outputs.layout, binding.layout(saved),
                binding.parameters, worker,
            )  # fmt: skip
            model._try_out()
        except ModelError:
            worker.close()
            raise
        for note in model.notes:
            log.info("%s: %s", path.name, note)
        return model

    # ------------------------------------------------------------------ a Model

    def initial(self, p: ParameterVector) -> StateVector:
        """The state after the FMU's initialisation with ``p``, (nx,).

        Raises:
            ModelError: it breaks down in it, and never went well before.
        """
        return self.worker.initial(np.ascontiguousarray(p, dtype=np.float64))

    def simulate(self, x: StateVector, u: Inputs, dt: Intervals, p: ParameterVector) -> Rollout:
        """State after the last row and the outputs of every row.

        A row in which the FMU breaks down, or gives no success, is NaN and leaves the state as it
        was; `faults` says what happened.
        """
        sized(x, self.states, p, self.parameters)
        return roll(self.kernel(), x, u, dt, p, Restart.never(len(u), len(self.outputs)))

    def observe(self, x: StateVector, y: Float64[np.ndarray, " ny"]) -> StateVector:
        """The state with outputs adopted that show a named state (same name or value reference)."""
        return adopted(x, y, self._adopts)

    @cached_property
    def _adopts(self) -> tuple[tuple[int, int], ...]:
        return tuple(self.binding.adopts)

    def kernel(self) -> Kernel:
        """Loops run where the FMU is; the addresses are callbacks that ask it row by row."""
        return self._kernel

    @cached_property
    def _kernel(self) -> Kernel:
        return python_kernel(_Rows(self))._replace(remote=self.worker)

    def __getstate__(self) -> dict[str, Any]:
        own = dict(self.__dict__)
        own.pop("_kernel", None)
        return own

    # ------------------------------------------------------------------ beyond it

    @property
    def faults(self) -> tuple[Fault, ...]:
        """What went wrong so far."""
        return tuple(self.worker.faults)

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know: how the memory is held, what no position update reaches."""
        binding = self.binding
        memory = {
            at.STATIC: "no memory: a static map",
            at.START: "memory: start values of " + ", ".join(binding.states.layout.names),
            at.SAVED: "memory: the state that the FMU saves",
            at.CONTINUOUS: f"memory: {len(binding.states.layout)} continuous states, solved by "
            f"{binding.options.solver}",
        }[binding.memory]
        notes = [memory]
        reached = {i for i, _ in self._adopts}
        missed = [name for i, name in enumerate(self.outputs.names) if i not in reached]
        if missed and len(self.states):
            notes.append(f"no position update reaches {', '.join(missed)}: no state shows there")
        bare = [
            v.name for v in (*binding.inputs.variables, *binding.outputs.variables,
                             *binding.tuned.variables)
            if not v.unit and v.name not in binding.options.units
        ]  # fmt: skip
        if bare:
            notes.append(f"no unit is given for {', '.join(bare)}: taken as '1'; options: units")
        return tuple(notes)

    def close(self) -> None:
        """Ends the child process; a later call starts it again."""
        self.worker.close()

    def _try_out(self) -> None:
        """Is the state all that the FMU remembers?

        Raises:
            ModelError: it does not start where it is told to, or remembers more than its state.
        """
        p = self.parameters.values
        x = self.initial(p)
        where, states = self.binding.where, ", ".join(self.binding.states.layout.names)
        if self.binding.memory == at.START and not self.worker.takes_states(p, x):
            raise ModelError(
                f"{where}: does not take start values for {states}: name the variables that do, "
                'states = { state = "start variable" }'
            )
        step = self.binding.options.step or self.binding.description.step or 1e-2
        # cut where no short period of something hidden would agree by chance
        dt = np.full(12, step)
        u = self._usual_inputs(12)
        _, whole = self.simulate(x, u, dt, p)
        middle, _ = self.simulate(x, u[:5], dt[:5], p)
        _ = self.simulate(x, u[:1], dt[:1], p)
        _, rest = self.simulate(middle, u[5:], dt[5:], p)
        size = _RATIO * (np.nanmax(np.abs(whole), axis=0, initial=0.0) + 1e-9)
        if not (np.abs(whole[5:] - rest) <= size)[np.isfinite(whole[5:])].all():
            raise ModelError(
                f"{where}: remembers more than {states or 'nothing'}, or depends on time: from a "
                "state in the middle it goes on differently; name all states, use saved states or "
                "model exchange, or say clock = true"
            )

    def _usual_inputs(self, rows: int) -> np.ndarray:
        """Start values of the inputs, a little apart."""
        group = self.binding.inputs
        start = [v for i in group.variables for v in (i.start or (0.0,)) * (
            1 if len(i.start) == i.size else i.size)]  # fmt: skip
        scaled = np.array(start) * np.array(group.group.factors) + np.array(group.group.offsets)
        wave = np.sin(1.0 + 0.7 * np.arange(rows))[:, None]
        low = [channel.low for channel in group.layout]
        high = [channel.high for channel in group.layout]
        moved = scaled[None, :] + 0.1 * (1.0 + np.abs(scaled)) * wave
        return np.ascontiguousarray(np.clip(moved, low, high).reshape(rows, len(scaled)))


class _Rows:
    """An Fmu row by row, for loops that cannot run where it lives; a lost row raises."""

    def __init__(self, model: Fmu) -> None:
        self.inputs, self.outputs = model.inputs, model.outputs
        self.states, self.parameters = model.states, model.parameters
        self._model = model

    def simulate(self, x: Any, u: Any, dt: Any, p: Any) -> tuple[Any, Any]:
        """One row.

        Raises:
            ModelError: the FMU was given up, or the row failed.
        """
        if not self._model.worker.alive:
            raise ModelError(f"{self._model.binding.where}: was given up")
        state, y = self._model.simulate(x, u, dt, p)
        if np.isnan(y).any():
            raise ModelError(f"{self._model.binding.where}: the row failed")
        return state, y

    def observe(self, x: Any, y: Any) -> Any:
        """As the model."""
        return self._model.observe(x, y)


def _look(path: Path, options: Options) -> tuple[Description, list[str]]:
    """Description and names of all entries, before anything is unpacked."""
    limits = options.unpacking
    with opened(path, limits) as archive:
        names = archive.namelist()
        if "modelDescription.xml" not in names:
            raise ModelError(
                f"{path.name}: expected modelDescription.xml in the archive, got none: not an FMU"
            )
        with archive.open("modelDescription.xml") as file:
            text = file.read(SIZE + 1)
    return parse_description(text, f"{path.name}: modelDescription.xml"), names


def _binary(binding: Binding, names: list[str]) -> str:
    """The folder of the library for this platform.

    Raises:
        ModelError: there is none; says which there are.
    """
    two, system, suffix = _SYSTEMS[sys.platform]
    machine = platform.machine().lower()
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    three = f"{machine}-{system}"
    wanted = three if binding.description.version.startswith("3") else two
    if f"binaries/{wanted}/{binding.interface.identifier}{suffix}" in names:
        return wanted
    there = sorted(
        {n.split("/")[1] for n in names if n.startswith("binaries/") and n.count("/") > 1}
    )
    raise ModelError(
        f"{binding.where}: expected a library for {wanted}, the FMU has "
        f"{', '.join(there) or 'none (only source code)'}: get it for this platform"
    )
