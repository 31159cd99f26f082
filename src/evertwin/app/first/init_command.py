"""``evertwin init``: a first twin file for recordings, written and shown."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import typer

from evertwin.app.console import Progress, show
from evertwin.app.first.init_site import first_without_file, read_machine
from evertwin.config import read
from evertwin.errors import UsageError
from evertwin.files import write_whole
from evertwin.machines.catalog import machine
from evertwin.prognosis.outlook.lone_series import Wear, wear_in
from evertwin.setup.configured_model import model_of
from evertwin.sources.columns.names import unit_problem
from evertwin.sources.recording import open_recording
from evertwin.starter import (
    ARM,
    PUMP,
    Draft,
    Proposal,
    Seen,
    answered,
    belonging,
    by_axis,
    joints_of,
    kind_of,
    look,
    mapped,
    needs_description,
    of_namespace,
    of_one_machine,
    options_of,
    own_model,
    pump,
    pump_model,
    stand_in,
    unforeseen,
)
from evertwin.starter.answers import (
    Answers,
    answers_of,
    with_answers,
    with_options,
    with_rates,
)
from evertwin.starter.channels.cause import stepped
from evertwin.starter.looks.words import words
from evertwin.starter.network_file import network_model
from evertwin.starter.numbers.network import Network
from evertwin.starter.proposal import ASK
from evertwin.starter.several import OUTSIDE, several, without_sides
from evertwin.starter.summary import summary

LOOKED = "the recordings are looked at"


class Said(NamedTuple):
    """What a person says of recordings. Without anything: nothing.

    >>> Said().answers
    ()
    """

    namespace: str = ""
    """Of the topics of one machine."""
    answers: Sequence[str] = ()
    """As NAME.WHAT=ANSWER."""
    sources: Mapping[Path, str] = MappingProxyType({})
    """Names that the sources of recordings have in a site file."""


NOTHING = Said()


def write_starter(
    files: Sequence[Path], out: Path | None, model: tuple[str, Path | None], force: bool,
    as_json: bool, said: Said = NOTHING,
) -> None:  # fmt: skip
    """Writes the twin file, and for ``python`` a model file beside it.

    A series that tells wear alone needs none: the command that tells its life is named. Of several
    axes driven by a force each gets a file. Where no kind is said (""), the headings say it, or it
    is a model of one's own.

    Args:
        model: kind, and the description of an arm.
        said: what a person says of them.

    Raises:
        UsageError: there is a file already, the model does not exist, or an answer is to nothing.
        DataError: a recording cannot be read, or holds no column of numbers.
    """
    kind, urdf = model
    kind = kind or ("arm" if urdf is not None else "")  # what else is described so?
    model = kind, urdf
    with Progress(LOOKED):
        lone = kind in ("", "python") and len(files) == 1 and not said.sources
        wear = wear_in(files[0]) if lone else None
        alone = wear is not None and wear.alone and not _switches(files[0])
    if wear is not None and alone:
        _name_life(files[0], wear, as_json)
        return
    answers = answers_of(said.answers)
    with Progress(LOOKED):
        seen, told = look(files)
        seen = with_rates(seen, answers)
        seen = tuple(replace(one, source=said.sources.get(one.files[0], "")) for one in seen)
    out = Path(f"{files[0].stem}.toml") if out is None else out
    with Progress(LOOKED):
        seen, others = _one_machine(seen, out, model, said.namespace)
        kind = kind or kind_of(seen)
        axes = by_axis(seen) if kind in ("drive", "drive_force") else (("", seen),)
    outs = [out.with_stem(f"{out.stem}_{word}") if word else out for word, _ in axes]
    for one in outs:
        if one.exists() and not force:
            raise UsageError(f"{one}: exists already: choose another name, or say --force")
    with Progress(LOOKED):
        drafts = [
            _draft(one, (kind, urdf), part, answers, guessed=not model[0], force=force)
            for one, (_, part) in zip(outs, axes, strict=True)
        ]
    for info in told:  # what is left out comes first
        for note in info.notes:
            where = "" if len(files) == 1 else f"{info.file}: "
            typer.echo(f"evertwin: {where}{note}", err=True)
    for draft in drafts if kind == "arm" and urdf is None else ():
        if reason := needs_description(draft.seen, draft.proposal.missing):
            raise UsageError(f"{files[0]}: {reason}")
    with Progress("the file is written"):
        contents = [_write(draft, force) for draft in drafts]
    content = contents[0] | ({"axes": contents} if len(contents) > 1 else {})
    show(content, "\n".join(summary(draft) for draft in drafts), as_json)
    if wear is not None:
        next_one = wear.command(str(files[0]))
        typer.echo(f"evertwin: does one of its columns tell wear? Then: {next_one}", err=True)
    odd = (note for draft in drafts for note in _odd_units(draft))
    described = (note for draft in drafts for note in getattr(draft.model, "notes", ()))
    for note in (*others, *odd, *(described if urdf is not None else ())):
        typer.echo(f"evertwin: {note}", err=True)


def _one_machine(
    seen: tuple[Seen, ...], out: Path, model: tuple[str, Path | None], namespace: str
) -> tuple[tuple[Seen, ...], tuple[str, ...]]:
    """The tables of the machine in the namespace that was said, or of one of several."""

    def proposed(part: tuple[Seen, ...]) -> Proposal | None:
        kind = model[0] or kind_of(part)
        if kind in ("python", PUMP):  # any table is enough for a model of one's own
            return None
        found = _draft(out, (kind, model[1]), part).proposal
        return None if found.questions else found

    return (of_namespace(seen, namespace), ()) if namespace else of_one_machine(seen, proposed)


def _own(out: Path) -> Path:
    """Where the model file of a twin file stands."""
    return out.with_name(f"{re.sub(r'[^A-Za-z0-9_]', '_', out.stem)}_model.py")


def _draft(
    out: Path, model: tuple[str, Path | None], seen: tuple[Seen, ...],
    answers: Answers = MappingProxyType({}), *, guessed: bool = False, force: bool = False,
) -> Draft:  # fmt: skip
    """With the options of the model that leave fewest questions, and with what was answered.

    Of a machine of one's own that several columns drive, or several answer of, or of a ``guessed``
    kind that leaves out what drives it, too, it is stores that act on each other.
    """
    draft = _asking(out, model, seen)
    network = several(seen, answers) if model[0] == "python" else None
    if guessed and model[0] not in ("python", PUMP, ARM, "arm"):
        network = _with_more(draft, answers)
    if network is not None:
        draft, answers = _network(out, seen, network, force), without_sides(answers)
    options = with_options(draft.options, answers)
    built = draft.model if options == draft.options else machine(draft.kind, answered(options))
    found = with_answers(draft.proposal, built, seen, answers)
    return replace(draft, options=options, model=built, proposal=found)


def _asking(out: Path, model: tuple[str, Path | None], seen: tuple[Seen, ...]) -> Draft:
    kind, urdf = model
    if kind == PUMP:
        return _pump(out, seen)
    if kind == ARM and urdf is None:
        return _arm(out, seen)
    kind = "arm" if kind == ARM else kind
    drafts = [
        Draft(out, kind, options, built, seen, belonging(mapped(built, seen), seen))
        for options in options_of(kind, urdf, _own(out))
        for built in (None if kind == "python" else machine(kind, answered(options)),)
    ]
    return min(drafts, key=lambda one: (len(one.questions), one.forced))


def _pump(out: Path, seen: tuple[Seen, ...]) -> Draft:
    """Of a machine that moves a fluid: its model file, unless there is one, and what feeds it."""
    own, found = _own(out), pump(seen)
    if not own.exists():
        write_whole(own, pump_model(seen, found))
    options = {"file": own.name, "name": "model"}
    built = machine("python", options | {"file": str(own)}, compiled=False)
    names = {(m.source, m.column) for m in found}
    rest = tuple(
        c.name for s, one in enumerate(seen) for c in one.columns if (s, c.name) not in names
    )
    return Draft(out, "python", options, built, seen, Proposal(found, (), (), rest))


def _with_more(draft: Draft, answers: Answers) -> tuple[Proposal, Network] | None:
    """Stores in place of a kind of machine that leaves out what drives it, too: of a box what acts
    from outside, or several heaters where its channels are not found."""
    more = set(draft.proposal.unused)
    acts = any(not OUTSIDE.isdisjoint(words(name)) for name in more)
    lacks = draft.proposal.missing if draft.kind == "thermal" else draft.untaken[0]
    if not (more and (acts or lacks)):
        return None
    found = several(draft.seen, answers)
    if found is None or more.isdisjoint(found[1].inputs):
        return None
    set_ = [name for name in found[1].inputs if stepped(draft.seen[0].values(name))]
    return found if acts or draft.kind != "thermal" or len(set_) > 1 else None


def _network(
    out: Path, seen: tuple[Seen, ...], told: tuple[Proposal, Network], force: bool
) -> Draft:
    """Of stores that several inputs fill: its model file, unless there is one, and columns."""
    own, (found, network) = _own(out), told
    if force or not own.exists():
        write_whole(own, network_model(network))
    options = {"file": own.name, "name": "model"}
    built = machine("python", options | {"file": str(own)}, compiled=False)
    read = tuple(
        one.name for column, one in network.inputs.items()
        if column in network.followed or not stepped(seen[0].values(column))
    )  # fmt: skip
    return Draft(out, "python", options, built, seen, found, measured=read)


def _arm(out: Path, seen: tuple[Seen, ...]) -> Draft:
    """Of an arm that is not described: its joints are known, of its bodies is asked."""
    built = machine("arm", stand_in(joints_of(seen)))
    options = {"urdf": ASK, "law": "tanh+load", "base": True, "payload": True}
    return Draft(out, "arm", options, built, seen, mapped(built, seen))


def _write(draft: Draft, force: bool) -> dict[str, Any]:
    """The twin file, and what it is as plain content."""
    out, own = draft.out, _own(draft.out)
    write_whole(out, draft.text())
    if draft.model is None and (force or not own.exists()):
        write_whole(own, own_model(draft.proposal.matches, draft.own))
    if not draft.questions:  # else the file holds a question, which no reader takes
        spec = read(out)
        if len(model_of(spec, compiled=False).states):
            write_whole(out, replace(draft, reach=unforeseen(spec)).text())
    return {
        "schema": "evertwin.init/1", "file": str(out),
        "model_file": str(own) if draft.kind == "python" else None, **draft.proposal.to_dict(),
        "questions": draft.questions,
    }  # fmt: skip


def _switches(file: Path) -> bool:
    """Does something switch there, which tells of a machine that is driven?"""
    return any(c.kind == "boolean" for t in open_recording(file).tables for c in t.columns)


def _name_life(file: Path, wear: Wear, as_json: bool) -> None:
    """Of a series that tells wear."""
    several = f"one file for each {wear.of}, {wear.series} in all, makes the others its fleet\n"
    text = (
        f"{file}: a series that tells wear: {', '.join(wear.columns)} by {wear.clock}, "
        f"{wear.rows} rows. It needs no twin file; X is where its life ends:\n"
        f"{several * bool(wear.of)}next: {wear.command(str(file))}"
    )
    show({"schema": "evertwin.init/1", "file": None, "next": wear.command(str(file)),
          "series": wear._asdict()}, text, as_json)  # fmt: skip


def _odd_units(draft: Draft) -> Iterator[str]:
    """What files state as units and are none."""
    for match in draft.proposal.matches:
        seen = draft.seen[match.source]
        unit = next((c.unit for c in seen.columns if c.name == match.column), "")
        problem = unit_problem(unit)
        if problem:
            yield (
                f"{seen.files[0].name}: column {match.column!r}: the unit {problem}: {draft.out} "
                f"takes its numbers as '{match.unit}'"
            )


def write_for_site(
    site: Path, seconds: float, out: tuple[Path | None, bool], model: tuple[str, Path | None],
    as_json: bool, said: Said,
) -> None:  # fmt: skip
    """The same for a machine that speaks: it is read, and the twin file is that of the site file.

    Args:
        site: site file; its first twin without a twin file is asked.
        seconds: for which the machine is read.
        out: twin file, None: as the site file says; and whether it may be there already.
        model: kind, and the description of an arm.
        said: what a person says of it.

    Raises:
        UsageError: each twin has its file, or the machine says nothing.
    """
    plan = first_without_file(site, out[1])
    found, notes = read_machine(plan, seconds)
    with_names = said._replace(sources=found)
    write_starter(tuple(found), out[0] or plan.file, model, out[1], as_json, with_names)
    for note in (*notes, f"as its machine speaks: evertwin doctor {site}, evertwin serve {site}"):
        typer.echo(f"evertwin: {note}", err=True)
