"""What a site file comes to, when what it names changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.loop.run import settings_hash
from evertwin.refit.workers import setup_of
from evertwin.service.site.site_plan import Site, read_site
from evertwin.signals.spoken import as_recorded

MODEL = """from evertwin.models import FunctionModel, Parameters
from evertwin.signals import Layout

cart = FunctionModel(
    lambda x, u, dt, p: ([x[0] + p[0] * dt * u[0]],) * 2,
    Layout.of(v="m/s"), Layout.of(x="m"), Layout.of(x="m"), Parameters.of(gain=(1.0, "1")),
)
"""
TWIN = """schema = 1
name = "cart"
[model]
kind = "python"
options = { file = "models.py", name = "cart" }
[[source]]
name = "log"
[source.channels]
v = { column = "v", unit = "m/s" }
x = { column = "x", unit = "m" }
"""


def test_a_model_s_file_that_changed_makes_another_plan_and_no_other_run(tmp_path: Path) -> None:
    """Also in the processes that fit: they keep what they built of a twin file."""

    def planned() -> Site:
        return read_site(tmp_path / "site.toml")

    (tmp_path / "site.toml").write_text('schema = 1\nname = "hall"\n[[twin]]\nfile = "cart.toml"\n')
    (tmp_path / "cart.toml").write_text(TWIN)
    (tmp_path / "models.py").write_text(MODEL)
    (before,) = planned().twins
    assert before.spec is not None and planned().twins == (before,)
    assert setup_of(before.spec).model.parameters.values.tolist() == [1.0]
    (tmp_path / "models.py").write_text(MODEL.replace("(1.0,", "(1.50,"))
    (after,) = planned().twins
    assert after.spec is not None and after != before
    assert setup_of(after.spec).model.parameters.values.tolist() == [1.5]
    assert settings_hash(after.spec) == settings_hash(before.spec)


@pytest.mark.parametrize(
    ("unit", "recorded", "shown"),
    [
        ("m", "cm", ("cm", 0.01, 0.0, "cm")),
        ("K", "degC", ("degC", 1.0, 273.15, "K")),
        ("Pa", "bar", ("bar", 1e5, 0.0, "bar")),
        ("m", "m", None),
        ("1", "1", None),
        ("rad", "deg", None),
    ],
)
def test_a_page_shows_an_output_in_the_unit_of_the_twin_file(
    unit: str, recorded: str, shown: tuple[str, float, float, str] | None
) -> None:
    """Degrees the page has anyway."""
    told = as_recorded(unit, recorded)
    assert (None if told is None else tuple(told.values())) == shown
