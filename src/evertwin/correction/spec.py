"""Settings of correction: what of the model's form may change, and how a table is learned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le, Lt

from evertwin.errors import UsageError
from evertwin.fold.span import Span
from evertwin.models.terms.registry import check_kind
from evertwin.settings.kinds import Duration, Finite, Radians, Size, Spread
from evertwin.settings.notes import Rows
from evertwin.settings.section import Section


@dataclass(frozen=True)
class SarsaSpec(Section):
    """``[correction.sarsa]``: what the agent that learns a table is rewarded for.

    The defaults are table 1 of Müller, Jazdi, Weyrich.

    >>> SarsaSpec().penalty
    -5.0
    """

    near: Size = 0.01
    """Deviation below which an action is rewarded."""
    reward: Finite = 1.0
    """Reward of such an action."""
    penalty: Finite = -5.0
    """Reward of any other."""
    end: Size = 0.02
    """Deviation beyond which an episode ends."""
    end_angle: Radians = 0.01
    """Rotational deviation beyond which an episode ends."""
    alpha: Annotated[float, Gt(0.0), Le(1.0)] | None = None
    """Learning rate; absent: 1 / number of visits."""
    gamma: Annotated[float, Ge(0.0), Lt(1.0)] = 0.0
    """Discount."""
    epsilon: Annotated[float, Ge(0.0), Le(1.0)] = 0.1
    """Share of actions tried at random (``replay`` and ``literal``)."""
    first: Finite = 0.0
    """Value of an action before it was tried."""
    accumulate: bool = False
    """Does the deviation add up over an episode?"""
    passes: Annotated[int, Ge(1), Le(100_000)] = 50
    """Times that ``replay`` goes through the log."""


@dataclass(frozen=True)
class CorrectionSpec(Section):
    """``[correction]``: how the model's form may be corrected.

    >>> CorrectionSpec().terms
    ()
    """

    channels: tuple[str, ...] = ()
    """Inputs (or states, for ``state`` and ``leak``) that may be corrected."""
    terms: tuple[str, ...] = ()
    """Kinds of term that may be tried: lag, slew, coupling, lever, current, law, direction,
    hysteresis, wheels, table, surface, state, leak, or one of another package; empty: the form
    stays."""
    outputs: tuple[str, ...] = ()
    """Outputs that terms have to pay on, on held-out rows and in their trial; empty: all."""
    learner: Literal["full", "replay", "literal"] = "full"
    """How a table is learned: with full information, by replay of the log, sample by sample."""
    quantum: Spread = 0.0
    """Step of a table's levels; 0: proposed from the data."""
    refine: bool = True
    """Replace a table by a continuous law where that predicts better."""
    watch: tuple[str, ...] = ()
    """Inputs for which the table was learned; when they change a new training sequence starts."""
    window: Annotated[Span, Rows(least=2)] = Span(6000)
    """Newest rows, or time, that a correction is learned on."""
    sarsa: SarsaSpec = SarsaSpec()
    """Settings of the agent that learns a table."""
    in_fit: bool = False
    """``fit`` searches for terms as well, judged on held-out parts of its recordings."""
    horizon: Duration | None = None
    """Length of the predictions that ``fit`` judges terms on; absent: that of ``[prediction]``."""

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.terms:
            check_kind(name)

    @classmethod
    def prepare(cls, table: Mapping[str, Any]) -> Mapping[str, Any]:
        """Channels alone are half of what was meant; ``terms = []`` says that the form stays."""
        if table.get("channels") and "terms" not in table:
            raise UsageError(
                'terms: expected the kinds that may be tried on the channels, as in ["lag", "law"]'
            )
        return table

    @property
    def translated(self) -> str:
        """The one input whose table an agent learns; empty: terms are searched for."""
        alone = "table" in self.terms and len(self.channels) == 1
        return self.channels[0] if alone else ""
