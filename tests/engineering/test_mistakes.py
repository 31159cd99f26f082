"""A mistake in a breakdown file is told with the line on which it stands."""

from pathlib import Path

import pytest

from evertwin.engineering.breakdown import BREAKDOWN, read_breakdown
from evertwin.engineering.criticality import history_of
from evertwin.errors import ConfigError, DataError

ARM = Path(__file__).parents[2] / "twins" / "breakdowns" / "arm.toml"
SENSED = 'sensors = ["tau{1..6}"]\nparameters.Fc'


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("effect_reason = \"friction and play", "efect_reason = \"friction and play",
         "[like.gearbox] unknown key 'efect_reason', did you mean 'effect_reason'?"),
        ("effect = 4\neffect_reason", "effect = 9\neffect_reason",
         "like.gearbox.effect: expected a number at least 1 and at most 5, got 9"),
        ('like = "gearbox"\naxis = ', 'like = "gearbx"\naxis = ', "did you mean 'gearbox'?"),
        ('name = "gearbox{1..6}"', 'name = "motor{1..6}"', "once, got 'motor1' twice"),
        (SENSED, SENSED.replace("tau", "taux"), "no [sensors.taux1]"),
        (SENSED, SENSED.replace("sensors", "sensr"), "did you mean 'sensors'?"),
        ('{ value = "{6,', '{ valu = "{6,', "unknown key 'valu', did you mean 'value'?"),
        ('study = ["control"', 'study = ["contrl"', "no system 'contrl'"),
    ],
)  # fmt: skip
def test_line_of_a_mistake(right: str, wrong: str, said: str) -> None:
    text = ARM.read_text(encoding="utf-8")
    assert text.count(right) >= 1
    line = text[: text.index(right)].count("\n") + 1
    with pytest.raises(ConfigError) as caught:
        BREAKDOWN.parse(text.replace(right, wrong, 1), "arm.toml")
    (only,) = str(caught.value).splitlines()
    assert only.startswith(f"arm.toml:{line}: ")
    assert said in only


def test_nested_like_is_refused() -> None:
    text = ARM.read_text(encoding="utf-8").replace("[like.gearbox]", '[like.gearbox]\nlike = "x"')
    with pytest.raises(ConfigError, match=r"arm.toml:34: \[like.gearbox\] is like nothing else"):
        BREAKDOWN.parse(text, "arm.toml")


def test_like_that_is_no_table() -> None:
    text = 'schema = 1\nname = "a"\nlike = 3\n[[system]]\nname = "s"\nlike = "x"\n'
    with pytest.raises(ConfigError, match=r":6: .*unknown key 'like'"):
        BREAKDOWN.parse(text, "a.toml")


def test_history_of_an_unknown_component(tmp_path: Path) -> None:
    text = ARM.with_name("arm_history.csv").read_text(encoding="utf-8")
    (tmp_path / "arm_history.csv").write_text(text.replace("gearbox3", "gearbx3"))
    (tmp_path / "arm.toml").write_text(ARM.read_text(encoding="utf-8"))
    with pytest.raises(DataError, match="no component 'gearbx3' in arm, did you mean 'gearbox3'"):
        history_of(read_breakdown(tmp_path / "arm.toml"))


def test_every_coulomb_torque_has_a_limit_of_health() -> None:
    arm = read_breakdown(ARM)
    limits = [arm.component(f"gearbox{k}").parameters["Fc"] for k in range(1, 7)]
    assert all(one.limit is not None and one.limit_reason for one in limits)
    assert all(one.limit > one.value for one in limits)
