"""Is the pose that of the point that the model moves, and does the command alone move it?

A marker, an antenna or a map's frame off that point, and what carries a base along, are sought as a
run seeks them: beside the model's numbers and a lag, and told where they pay on rows held out.
"""

from __future__ import annotations

from collections.abc import Iterator

from evertwin.correction.search.improve import Proposal, Selection, improve
from evertwin.correction.search.own_numbers import few_numbers
from evertwin.doctor.examination import View
from evertwin.doctor.finding import Finding
from evertwin.errors import TooFew
from evertwin.fold import Block, take
from evertwin.models.terms.of_pose import POSE, posed
from evertwin.refit.numbers.posterior import posterior

ROWS = 3000
"""Rows of each recording that are looked at."""
STEPS = {
    "lever": "say so by ahead and aside in [model] options, or let it be learned",
    "current": "let it be learned, if something carries the base",
}
"""Kinds of term that are told, and what to do then."""


def look_pose(view: View) -> Iterator[Finding]:
    """What the pose does besides what is commanded, of a base with a pose in the plane."""
    setup, model = view.setup, view.model
    if min(posed(model.outputs), posed(model.states)) < 0 or view.slow:
        return
    windows = tuple(take(w, 0, min(len(w.t), ROWS)) for w in view.some(view.judged))
    found = _found(view, windows)
    if found is None or not found.found:
        return
    names = setup.model.parameters.names
    moved = tuple(n for n, a, b in zip(names, found.p, view.version.p, strict=False) if a != b)
    known = posterior(setup, view.versions.model_of(found.form), found, windows, moved) or {}
    said = known.get("describes", found.describes)
    allowed = setup.spec.correction.terms
    for gain in found.gains:
        if (kind := gain.term.kind) in STEPS:
            told = said[[id(term) for term in found.form.terms].index(id(gain.term))]
            name = "" if kind in allowed else f' ([correction] terms = [..., "{kind}"])'
            yield Finding(
                kind, POSE[0],
                f"{told}: {100 * gain.gain:.0f} % less deviation on rows held out",
                f"rows 0 to {sum(len(w.t) for w in windows) - 1}",
                f"{STEPS[kind]}{name}", {"gain": gain.gain, "segments": gain.segments},
            )  # fmt: skip


def _found(view: View, windows: tuple[Block, ...]) -> Proposal | None:
    numbers = view.setup.editable
    settings = Selection(("lag", *STEPS), numbers=numbers, beside=few_numbers(numbers))
    form, p = view.version.form, view.version.p
    try:
        return improve(view.setup.model, form, windows, view.horizon, settings, p)
    except TooFew:  # the horizon's finding says so
        return None
