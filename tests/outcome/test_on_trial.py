"""What is told of a challenger on trial."""

from __future__ import annotations

from evertwin.fold import take
from evertwin.ledger.versions import Versions
from evertwin.outcome.open.on_trial import open_trial
from evertwin.setup.configured_model import model_of
from evertwin.setup.setup import Setup
from evertwin.setup.twin_state import TRIAL
from tests.loop.machines import arm, play


def test_a_trial_of_a_version_that_was_live_before_began_when_it_came_back() -> None:
    case = arm()
    setup = Setup(case.spec, model_of(case.spec)).at(10.0)
    runs = (play(case, [take(case.rows, 0, rows)]) for rows in range(360, 960, 40))
    run = next(run for run in runs if run.state.agenda.phase == TRIAL)
    versions = Versions(setup.model)
    for version in run.versions[len(versions) :]:
        versions.add(
            version.form, dict(zip(version.names, version.values, strict=True)),
            parent=version.parent, reason=version.reason, row=version.row,
        )  # fmt: skip
    made = versions[run.state.other.version].row
    late = run.state._replace(
        row=made + 1000, elapsed=run.state.elapsed + 10**11,
        agenda=run.state.agenda._replace(tried=run.state.elapsed + 95 * 10**9),
    )  # fmt: skip
    for state, since in ((run.state, made), (late, made + 950)):
        found = open_trial(setup, versions, state)
        assert found is not None and found.since == since
