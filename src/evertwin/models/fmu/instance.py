"""The FMU in its own process: loading, starting it at a state, its events. Over FMPy.

What happens once per start is written here in Python; what happens per row is compiled
(`evertwin.models.fmu.kernels`) and calls the same functions by address.

This module is imported in the child process only.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import fmpy.fmi2 as fmi2
import fmpy.fmi3 as fmi3
import numpy as np
from fmpy.fmi1 import FMICallException

from evertwin.models.fmu import kernels
from evertwin.models.fmu import slots as at

_CALLBACK = ctypes.CFUNCTYPE(
    ctypes.c_int64, *[ctypes.POINTER(ctypes.c_int64)], *[ctypes.POINTER(ctypes.c_double)] * 2
)
_ROUNDS = 100
"""Event iterations before a row fails."""


def address(function: Any) -> int:
    """Where a C function or callback is."""
    return ctypes.cast(function, ctypes.c_void_p).value or 0


class Instance:
    """One instance of a loaded FMU.

    >>> Instance.__name__
    'Instance'
    """

    def __init__(self, plan: Mapping[str, Any]) -> None:
        self.plan = plan
        self.three = plan["version"].startswith("3")
        self.exchange = plan["interface"] == "model-exchange"
        room: Any = fmi3 if self.three else fmi2
        kind = getattr(room, f"FMU{3 if self.three else 2}{'Model' if self.exchange else 'Slave'}")
        self.fmu: Any = kind(
            guid=plan["token"], modelIdentifier=plan["identifier"], unzipDirectory=plan["folder"],
            instanceName="twin",
        )  # fmt: skip
        self._instantiate()
        self.used = False
        self.page = np.zeros(0, dtype=np.int64)
        self.numbers = np.zeros(0)
        self.values = np.zeros(0)
        self._keep: list[Any] = []

    def _instantiate(self) -> None:
        if self.three:
            # C's own printf formats nothing here: the message is text already
            self.fmu.instantiate(logMessage=_quiet3)
        else:
            self.fmu.instantiate(loggingOn=False)

    # ------------------------------------------------------------------ the page

    def attach(self, page: np.ndarray) -> None:
        """Fills in addresses; called once, and again where the page moved."""
        self.page, self.numbers = page, page.view(np.float64)
        calls = self.fmu._functions
        prefix = "fmi3" if self.three else "fmi2"

        def of(*names: str) -> int:
            found = [calls[prefix + name] for name in names if prefix + name in calls]
            return address(found[0]) if found else 0

        restore, events, leave = _CALLBACK(self.restore), _CALLBACK(self.events), _libc()._exit
        self._keep = [restore, events, leave]
        page[at.THREE], page[at.HELD] = int(self.three), 0
        page[at.COMPONENT] = _pointer(self.fmu.component)
        page[at.RESTORE], page[at.EVENTS] = address(restore), address(events)
        page[at.LEAVE] = address(leave)
        page[at.SET], page[at.GET] = of("SetReal", "SetFloat64"), of("GetReal", "GetFloat64")
        if self.exchange:
            page[at.SETTIME] = of("SetTime")
            page[at.SETX], page[at.GETX] = of("SetContinuousStates"), of("GetContinuousStates")
            page[at.GETDX] = of("GetDerivatives", "GetContinuousStateDerivatives")
            page[at.COMPLETED] = of("CompletedIntegratorStep") if self.plan["completes"] else 0
            page[at.GETZ] = of("GetEventIndicators")
        else:
            page[at.DOSTEP] = of("DoStep")
        page[at.GETSTATE] = of("GetFMUstate", "GetFMUState")
        page[at.SETSTATE] = of("SetFMUstate", "SetFMUState")
        page[at.FREESTATE] = of("FreeFMUstate", "FreeFMUState")
        page[at.SIZESTATE] = of("SerializedFMUstateSize", "SerializedFMUStateSize")
        page[at.WRITESTATE] = of("SerializeFMUstate", "SerializeFMUState")

    # ------------------------------------------------------------------ starting

    def begin(self, p: Sequence[float], x: Sequence[float] | None, time: float) -> None:
        """Initialises anew, with parameters and (where given) start values in the FMU's units."""
        if self.used:
            self._reset()
        self.used = True
        plan, fmu = self.plan, self.fmu
        self._set(plan["start_references"], plan["start_values"])
        self._set(plan["parameters"], p)
        if x is not None and plan["starts"]:
            self._set(plan["starts"], x)
        if self.three:
            fmu.enterInitializationMode(startTime=time)
        else:
            fmu.setupExperiment(startTime=time)
            fmu.enterInitializationMode()
        fmu.exitInitializationMode()
        if self.exchange:
            self._iterate()
        if len(self.page):
            self.numbers[self.page[at.REALS] + at.TIME] = time

    def _reset(self) -> None:
        try:
            self.fmu.reset()
        except FMICallException as error:
            if error.status >= at.FATAL:
                raise
            calls = self.fmu._functions
            calls["fmi3FreeInstance" if self.three else "fmi2FreeInstance"](self.fmu.component)
            self._instantiate()
            if len(self.page):
                self.page[at.COMPONENT] = _pointer(self.fmu.component)

    def _set(self, references: Sequence[int], values: Sequence[float]) -> None:
        if len(values):
            (self.fmu.setFloat64 if self.three else self.fmu.setReal)(references, list(values))

    def _iterate(self) -> None:
        """Event iteration to its end, then continuous time."""
        for _ in range(_ROUNDS):
            new = self.fmu.updateDiscreteStates() if self.three else self.fmu.newDiscreteStates()
            if new[1]:
                raise FMICallException("the FMU asked to end the simulation", at.ERROR)
            if not new[0]:
                self.fmu.enterContinuousTimeMode()
                return
        raise FMICallException(f"event iteration: no end after {_ROUNDS} rounds", at.ERROR)

    # ------------------------------------------------------------------ called from compiled code

    def restore(self, _: Any, x: Any, p: Any) -> int:
        """Puts the FMU where ``x`` and ``p`` say; FMI's status."""
        sizes = int(self.page[at.NX]), int(self.page[at.NP])
        given = [np.ctypeslib.as_array(a, (n,)).copy() if n else np.zeros(0)
                 for a, n in zip((x, p), sizes, strict=True)]  # fmt: skip
        return _status(lambda: self._restore(*given))

    def _restore(self, x: Any, p: Any) -> None:
        page, memory = self.page, self.page[at.MEMORY]
        parameters = self._raw(at.P, p)
        time = float(x[page[at.CLOCK]]) if page[at.CLOCK] >= 0 else 0.0
        n = int(page[at.group_at(at.X)])
        states = self._raw(at.X, x[:n])
        broken = page[at.HELD] == 0 and page[at.BAD] > 0
        changed = not np.array_equal(self.values, p) or not self.used or broken
        if memory == at.CONTINUOUS:
            if changed:
                self.begin(parameters, None, time)
            if page[at.NZ]:
                self._settle(states)
        elif memory == at.SAVED:
            if not self.used or broken:
                self.begin(parameters, None, time)
            self._revive(x, n, parameters)
        else:
            self.begin(parameters, states if memory == at.START else None, time)
        self.values = p

    def _raw(self, group: int, values: Any) -> list[float]:
        """From SI to the FMU's units."""
        n, _, _, factor, offset, _ = self.page[at.group_at(group) :][: at.FIELDS].tolist()
        raw = (values - self.numbers[offset : offset + n]) / self.numbers[factor : factor + n]
        return list(raw.tolist())

    def _settle(self, states: Sequence[float]) -> None:
        """A new continuous state may switch the FMU's events."""
        self.fmu.setTime(float(self.numbers[self.page[at.REALS] + at.TIME]))
        self.fmu.setContinuousStates((ctypes.c_double * len(states))(*states), len(states))
        self.fmu.enterEventMode()
        self._iterate()

    def events(self, _: Any, work: Any, __: Any) -> int:
        """Event iteration; the states behind it go into ``work``."""
        return _status(lambda: self._events(work))

    def _events(self, work: Any) -> None:
        self.fmu.enterEventMode()
        self._iterate()
        n = int(self.page[at.group_at(at.X)])
        if n:
            self.fmu.getContinuousStates(work, n)

    # ------------------------------------------------------------------ saved states

    def saved_size(self) -> int:
        """Bytes of the saved state."""
        state = self.fmu.getFMUState()
        size = len(self.fmu.serializeFMUState(state))
        self.fmu.freeFMUState(state)
        return size

    def _revive(self, x: Any, n: int, parameters: Sequence[float]) -> None:
        b, capacity = int(self.page[at.BYTES]), int(self.page[at.CAPACITY])
        size = int(x[b])
        words = x[b + 1 : b + capacity].astype(np.int64)
        raw = words.view(np.uint8).reshape(-1, 8)[:, :6].tobytes()[:size]
        state = self.fmu.deserializeFMUState(raw)
        self.fmu.setFMUState(state)
        self.fmu.freeFMUState(state)
        self._set(self.plan["parameters"], parameters)
        if n and not np.array_equal(self._shown(n), x[:n]):
            self._set(self.plan["states"], self._raw(at.X, x[:n]))

    def _values(self, group: int, raw: Sequence[float]) -> Any:
        n, _, _, factor, offset, _ = self.page[at.group_at(group) :][: at.FIELDS].tolist()
        scale = self.numbers[factor : factor + n], self.numbers[offset : offset + n]
        return np.array(raw, dtype=np.float64) * scale[0] + scale[1]

    def initial(self, p: Any, x: Any) -> None:
        """State after initialising with parameters ``p``, into ``x``."""
        self.begin(self._raw(at.P, p), None, 0.0)
        self.values = p.copy()
        page, memory = self.page, self.page[at.MEMORY]
        page[at.HELD] = 0
        n = int(page[at.group_at(at.X)])
        x[:] = 0.0
        if memory == at.CONTINUOUS and n:
            raw = (ctypes.c_double * n)()
            self.fmu.getContinuousStates(raw, n)
            x[:n] = self._values(at.X, list(raw))
        elif memory != at.STATIC:
            x[:n] = self._shown(n)
        if memory == at.SAVED and kernels.pack.compiled(page, self.numbers, x) > 1:
            raise FMICallException("the state cannot be saved, or grew", at.ERROR)

    def _shown(self, n: int) -> Any:
        """The FMU's named states, in SI."""
        found = np.empty(n)
        if kernels.get_group.compiled(self.page, self.numbers, at.X, found) > 1:
            raise FMICallException("the states cannot be read", at.ERROR)
        return found

    def takes_states(self, p: Any, x: Any) -> bool:
        """Does the FMU start where it is told to?"""
        n = int(self.page[at.group_at(at.X)])
        wanted = x[:n] + 1e-3 * (1.0 + np.abs(x[:n]))
        self.begin(self._raw(at.P, p), self._raw(at.X, wanted), 0.0)
        return bool(np.allclose(self._shown(n), wanted, rtol=1e-9, atol=1e-12))


def _status(work: Callable[[], None]) -> int:
    """FMI's status of what compiled code asks for; Fatal ends the process."""
    try:
        work()
    except FMICallException as error:
        if error.status >= at.FATAL:
            _libc()._exit(at.EXIT_FATAL)
        return max(int(error.status), at.ERROR)
    return 0


def _pointer(component: Any) -> int:
    value = getattr(component, "value", component)
    return int(value or 0)


def _libc() -> Any:
    return ctypes.CDLL(None)


def _quiet3(environment: Any, status: Any, category: Any, message: Any) -> None:
    """The FMU's log is not kept: a status says what the twin has to know."""
