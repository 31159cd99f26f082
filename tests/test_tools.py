"""The runner of the documentation's commands is able to fail; what the tools name is there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import jaxtyping
import numpy as np
import pytest
from beartype import beartype
from jaxtyping import Float64, TypeCheckError

from evertwin.rows.ring import Ring
from evertwin.tuning.residuals.shapes import shapes
from tools import compile_kernels

ROOT = Path(__file__).parent.parent

PAGE = """
<!-- run -->
```console
$ printf 'a\\n' > kept.txt
shown output, not run
$ test -e kept.txt && \\
    echo joined
```

<!-- run exit=3 -->
```bash
test -e kept.txt
exit 3
```

<!-- run -->
```python
import pathlib
assert pathlib.Path("kept.txt").read_text() == "a\\n"
```

<!-- not run: needs a robot -->
```console
$ false
```

```toml
anything = "no command"
```
"""


def run(tmp_path: Path, text: str) -> subprocess.CompletedProcess[str]:
    page = tmp_path / "page.md"
    page.write_text(text, encoding="utf-8")
    command = [sys.executable, str(ROOT / "tools" / "run_docs.py"), str(page)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_page_that_keeps_its_word_passes(tmp_path: Path) -> None:
    done = run(tmp_path, PAGE)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "documentation: 3 ok, 1 shown" in done.stdout


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("exit 3", "exit 4"), "expected exit code 3, got 4"),
        (("<!-- run exit=3 -->", ""), "FAILED: no <!-- run -->"),
        (("<!-- run exit=3 -->", "<!-- run exit=3 -->\n\ntext between"), "FAILED: no <!-- run -->"),
        (("not run: needs a robot", "not run"), "'not run' without a reason"),
        (('== "a\\n"', '== "b"'), "AssertionError"),
        (("exit 3", "sleep 9"), "took more than 1 s"),
    ],
)
def test_a_page_that_does_not_fails(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    text = PAGE.replace(*change)
    assert text != PAGE
    if "took" in message:
        text = text.replace("exit=3", "exit=3 timeout=1")
    done = run(tmp_path, text)
    assert done.returncode == 1
    assert message in done.stdout


def test_what_failed_is_told_again_at_the_end(tmp_path: Path) -> None:
    loud = "for i in $(seq 50); do echo line $i; done; exit 4"
    text = PAGE.replace("exit 3", loud) + "\n<!-- run -->\n```bash\necho fine\n```\n"
    _, _, end = run(tmp_path, text).stdout.partition("documentation: 1 FAILED, 3 ok, 1 shown\n")
    first, *rest = end.splitlines()
    assert first.endswith("page.md:11: FAILED: expected exit code 3, got 4")
    assert rest == [f"line {i}" for i in range(21, 51)]


def test_the_readme_shows_both_commands() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "make demo" in text
    assert "make test" in text
    assert "macOS and Windows are untested" in text


def test_a_silent_command_shows_that_it_lives(tmp_path: Path) -> None:
    tool = (ROOT / "tools" / "alive.py").read_text()
    copy = tmp_path / "alive.py"
    copy.write_text(tool.replace("SILENCE = 2.0", "SILENCE = 0.1"))
    code = "import time; print('one'); time.sleep(1); print('two'); raise SystemExit(3)"
    command = [sys.executable, str(copy), "waiting", sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = done.stdout.splitlines()
    alive = [line for line in lines if line.startswith("waiting ... ")]
    assert done.returncode == 3 and len(alive) >= 3
    assert [line for line in lines if line not in alive] == ["waiting ...", "one", "two"]


def test_the_tests_that_compile_the_loops_are_there() -> None:
    for name in compile_kernels.TESTS:
        path, _, test = name.partition("::")
        assert f"def {test}(" in (ROOT / path).read_text() if test else (ROOT / path).is_file(), (
            name
        )


@pytest.mark.parametrize("test", ["one", "the next"])
def test_shapes_are_checked_in_the_first_calls_of_each_test(test: str) -> None:
    with pytest.raises(TypeCheckError, match=r"evertwin\.tuning\.residuals\.shapes\.shapes"):
        shapes(np.zeros((60, 2)))
    with pytest.raises(TypeCheckError, match=r"evertwin\.rows\.ring\.Ring"):
        Ring(capacity=2.5, nu=1, ny=1)  # type: ignore[arg-type]
    for _ in range(200):  # else the next test would not be checked
        shapes(np.zeros(60))


def test_what_comes_of_sound_arguments_is_checked_each_time_it_is_of_another_kind() -> None:
    calls = []

    @jaxtyping.jaxtyped(typechecker=beartype)
    def without(values: Float64[np.ndarray, " n"], *, first: int) -> Float64[np.ndarray, " n"]:
        calls.append(first)
        return values[first:]

    assert without(np.zeros(4), first=0).size == 4
    with pytest.raises(TypeCheckError, match=r"return value .*without"):
        without(np.zeros(4), first=1)
    with pytest.raises(TypeCheckError, match=r"parameters .*without"):
        without(np.zeros(4), first="one")  # type: ignore[arg-type]
    assert without(np.zeros(4), first=0).size == 4 and calls == [0, 1, 0]
