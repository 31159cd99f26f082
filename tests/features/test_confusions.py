"""What a detector takes for what, on both sides: what is told, and what cannot be."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from evertwin.app.cli import main
from evertwin.errors import DataError, UsageError
from evertwin.features.images.confusions import confusions
from evertwin.features.images.labelled import NOTHING, Labelled, read_labelled

CLASSES = ("box", "chair", "table")


def rows(
    simulated: np.ndarray, real: np.ndarray, seed: int, each: int = 300, scene: int = 1
) -> Labelled:
    """Labels drawn from two tables; in a scene of several rows all are taken for the same."""
    rng = np.random.default_rng(seed)
    truth, label, side, group = [], [], [], []
    for k, table in enumerate((simulated, real)):
        for i, name in enumerate(CLASSES):
            own = np.repeat(rng.choice(CLASSES, each // scene, p=table[i]), scene)
            truth += [name] * len(own)
            label += own.tolist()
            side += [k == 0] * len(own)
            group += [1_000_000 * k + 10_000 * i + j // scene for j in range(len(own))]
    number = np.unique(group, return_inverse=True)[1] if scene > 1 else None
    return Labelled.of(truth, label, side, number)


ALIKE = np.array([[0.9, 0.05, 0.05], [0.03, 0.94, 0.03], [0.1, 0.02, 0.88]])
OTHER = np.array([[0.9, 0.05, 0.05], [0.03, 0.94, 0.03], [0.25, 0.02, 0.73]])


def test_what_differs_is_found_and_nothing_else() -> None:
    for seed in range(5):
        found = confusions(rows(ALIKE, OTHER, seed))
        assert found.differ
        assert [(c.truth, c.label) for c in found.cells if c.differs] == [("table", "box")]
        assert not confusions(rows(ALIKE, ALIKE, seed)).differ


def test_one_cell_is_fishers_test() -> None:
    """With a single confusion there is nothing to correct."""
    truth = ["a"] * 60
    label = ["b"] * 3 + ["a"] * 27 + ["b"] * 12 + ["a"] * 18
    found = confusions(Labelled.of(truth, label, [True] * 30 + [False] * 30))
    p = stats.fisher_exact([[3, 27], [12, 18]]).pvalue
    assert found.cells[0].p == pytest.approx(p, abs=3 * np.sqrt(p / 9999))


def test_images_of_one_scene_are_not_many() -> None:
    """Without a difference: called by rows, not by groups; the intervals are wider, too."""
    calls = {True: 0, False: 0}
    for seed in range(8):
        known = rows(ALIKE, ALIKE, seed, each=300, scene=20)
        calls[True] += confusions(known).differ
        bare = Labelled(known.classes, known.truth, known.label, known.simulated, known.probability)
        calls[False] += confusions(bare).differ
    assert calls[True] == 0 and calls[False] >= 3
    wide, narrow = (confusions(one).most(True, 1)[0].simulated for one in (known, bare))
    assert wide.high - wide.low > 2 * (narrow.high - narrow.low)


def test_what_cannot_be_told_is_said() -> None:
    few = confusions(Labelled.of(["a"] * 6, ["a", "a", "b", "a", "a", "a"], [True, False] * 3))
    assert not few.differ and few.smallest > 0.01
    sides = Labelled.of(["a", "b"], ["b", "b"], [True, False])
    alone = confusions(sides)
    assert alone.alone == ("a", "b") and np.isnan(alone.p) and not alone.differ


def written(file: Path, lines: list[str]) -> Path:
    file.write_text("\n".join([*lines, ""]))
    return file


def test_files(tmp_path: Path) -> None:
    one = written(tmp_path / "a.csv", ["True_Label,score,predicted", "1,.9,1", "2,.2,1", ",.8,2"])
    two = written(tmp_path / "b.csv", ["truth,label,probability", "1,1,.9", "2,2,.9", "2,,.9"])
    found = read_labelled([one, two])
    assert (
        found.classes == (NOTHING, "1", "2")
        and found.simulated.tolist() == [True] * 3 + [False] * 3
    )
    assert [found.classes[k] for k in found.label] == ["1", "1", "2", "1", "2", NOTHING]
    least = read_labelled([one, two], least=0.5)
    assert [least.classes[k] for k in least.label] == ["1", NOTHING, "2", "1", "2", NOTHING]


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["truth,label", "a,b"], "side"),
        (["truth,label,side", "a,b,simulated"], "real rows"),
        (["truth,label,side", "a,b,here"], ":2: side"),
        (["truth,side", "a,simulated"], "'label'"),
    ],
)
def test_what_is_no_table_of_labels_is_refused(
    tmp_path: Path, lines: list[str], words: str
) -> None:
    with pytest.raises(DataError, match=words):
        read_labelled([written(tmp_path / "a.csv", lines)])


def test_a_least_probability_needs_one(tmp_path: Path) -> None:
    file = written(tmp_path / "a.csv", ["truth,label,side", "a,b,sim", "a,b,real"])
    with pytest.raises(UsageError, match="probability"):
        read_labelled([file], least=0.5)


def test_the_command_names_what_to_randomise(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A confusion that comes in the dark, which the simulation hardly draws."""
    rng = np.random.default_rng(3)
    lines = ["truth,label,side,light,distance,scene"]
    for side in ("simulated", "real"):
        for k in range(1500):
            light = rng.uniform(0.25 if side == "simulated" and k % 8 else 0.0, 1.0)
            taken = "shelf" if rng.random() < (0.6 if light < 0.25 else 0.02) else "table"
            lines.append(f"table,{taken},{side},{light:.3f},{rng.uniform(1, 4):.2f},{side}{k}")
    file = written(tmp_path / "labels.csv", lines)
    with pytest.raises(SystemExit) as ended:
        main(["confusions", str(file), "--json", "--check"])
    assert ended.value.code == 1
    told = json.loads(capsys.readouterr().out)
    assert told["differ"] and [one["settings"][0]["setting"] for one in told["cells"]] == ["light"]
    assert {one["setting"]: one["wide"] for one in told["coverage"]} == {
        "light": False, "distance": True,
    }  # fmt: skip
    with pytest.raises(SystemExit):
        main(["confusions", str(file)])
    text = capsys.readouterr().out
    assert "randomise light towards low values" in text and "too narrow" in text


def test_bad_calls_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path / "a.csv", ["truth,label,side", "a,b,sim", "a,b,real"])
    for more in (["--level", "2"], ["--most", "0"], [str(file), str(file)]):
        with pytest.raises(SystemExit) as ended:
            main(["confusions", str(file), *more])
        assert ended.value.code == 2
    capsys.readouterr()
    with pytest.raises(SystemExit) as ended:
        main(["confusions", str(file)])
    assert ended.value.code == 0 and "cannot be told" in capsys.readouterr().out


def test_probabilities_in_percent_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "labels.csv"
    file.write_text("truth,label,probability,side\na,a,90,simulated\na,b,80,real\n")
    with pytest.raises(DataError, match="from 0 to 1, got 90: percent"):
        read_labelled([file], least=0.6)


@pytest.mark.parametrize("seed", range(3))
def test_what_would_be_told_is_said_of_groups_too(seed: int) -> None:
    alone = confusions(rows(ALIKE, ALIKE, seed)).detectable
    together = confusions(rows(ALIKE, ALIKE, seed, scene=10)).detectable
    assert 0 < alone < 0.5 * together
