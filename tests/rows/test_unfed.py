"""Files that all went to one source are named where another lacks its own."""

from __future__ import annotations

from pathlib import Path

import pytest

from evertwin.errors import ConfigError
from evertwin.twin import Twin

SOURCE = """[[source]]
name = "{0}"
{2}time = {{ column = "t", unit = "s" }}
[source.channels]
{1} = {{ column = "{1}", unit = "1" }}
"""


@pytest.mark.parametrize(("match", "said"), [("", True), ('match = "*_cmd.csv"\n', False)])
def test_files_that_went_to_the_first_source_are_named(
    tmp_path: Path, match: str, said: bool
) -> None:
    rows = "".join(f"{0.1 * i:.1f},0.2,{0.02 * i:.3f}\n" for i in range(60))
    files = [tmp_path / "run_cmd.csv", tmp_path / "run_odom.csv"]
    for file in files:
        file.write_text(f"t,v,x\n{rows}")
    twin = tmp_path / "base.toml"
    head = 'schema = 1\nname = "b"\n[model]\nkind = "robot1d"\n[clock]\nrate = "10 Hz"\n'
    units = {"v": "m/s", "x": "m"}
    sources = [SOURCE.format("cmd", "v", match), SOURCE.format("odom", "x", "")]
    text = head + "".join(sources)
    for channel, unit in units.items():
        text = text.replace(f'"{channel}", unit = "1"', f'"{channel}", unit = "{unit}"')
    twin.write_text(text)
    if said:
        with pytest.raises(ConfigError, match=r"run_cmd.csv, run_odom.csv went to source cmd, none "
                           r"to odom: does \[\[source\]\] match tell them apart\?"):  # fmt: skip
            Twin.open(twin).run([str(file) for file in files])
    else:
        Twin.open(twin).run([str(file) for file in files])
