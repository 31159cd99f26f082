"""A first twin file for recordings: which column feeds which channel, and what is left to ask."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.starter.channels.axes import by_axis as by_axis
    from evertwin.starter.draft import Draft as Draft
    from evertwin.starter.channels.joints import joints_of as joints_of, stand_in as stand_in
    from evertwin.starter.kinds import (
        ARM as ARM, PUMP as PUMP, kind_of as kind_of, pump as pump,
    )  # fmt: skip
    from evertwin.starter.channels.mapping import mapped as mapped
    from evertwin.starter.model_file import own_model as own_model, pump_model as pump_model
    from evertwin.starter.channels.namespaces import (
        belonging as belonging, of_namespace as of_namespace, of_one_machine as of_one_machine,
    )  # fmt: skip
    from evertwin.starter.options import (
        answered as answered, needs_description as needs_description, options_of as options_of,
    )  # fmt: skip
    from evertwin.starter.proposal import (
        Derivation as Derivation, Match as Match, Proposal as Proposal,
    )  # fmt: skip
    from evertwin.starter.numbers.reach import unforeseen as unforeseen
    from evertwin.starter.looks.seen import Seen as Seen, look as look

__getattr__ = surface(__name__)
