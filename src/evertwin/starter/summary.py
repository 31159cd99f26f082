"""What was found for a first twin file, for a terminal."""

from __future__ import annotations

from collections.abc import Iterator

from evertwin.starter.draft import Draft
from evertwin.starter.options import stands_in
from evertwin.starter.proposal import ASK, together


def summary(draft: Draft) -> str:
    """What was found, for a terminal."""
    lines = [f"{draft.out}: {draft.kind}, {len(draft.proposal.matches)} channels found"]
    several = len(draft.sources) > 1
    for source in draft.sources:
        for m in source.matches:
            where = f"{source.name}: {m.column}" if several else m.column
            lines.append(f"  {m.channel:<10} {where:<24} {m.unit:<8} {m.reason}")
    derived = ((d.name, f"{d.op} of {', '.join(d.of)}") for d in draft.proposal.derivations)
    lacking = ((name, "no column found") for name in draft.proposal.missing)
    lines += [f"  {name:<10} {said}" for name, said in together([*derived, *lacking])]
    lines += [f"  {said}"] if (said := stands_in(draft.options)) else []
    lines += _left_out(draft)
    if draft.questions:
        lines.append(f"to be answered in {draft.out}, where it says {ASK!r}:")
        asked = together((name, what) for name, _, what in map(_cut, draft.questions))
        lines += [f"  {name}: {what}" for name, what in asked]
        name, _, what = _cut(draft.questions[0])
        lines.append(
            f"  or answer here, and times and requirement are proposed by it: evertwin init … "
            f"--force --answer {name}.{what.split()[0]}=…"
        )
        if any(m.channel in ("u", "y") and m.column == ASK for m in draft.proposal.matches):
            lines.append(
                "  where several drive or answer, name them all: --answer "
                'u.column="COLUMN, COLUMN" --answer y.column="COLUMN, COLUMN"'
            )
    if draft.undescribed and draft.model is not None:
        lines.append(
            f"its {len(draft.model.outputs)} joints are found, its bodies have to be described: "
            "--model arm --urdf FILE, or a DH table (docs/how-to/arm-of-your-own.md)"
        )
    lines.append(f"next: evertwin doctor {draft.out}")
    return "\n".join(lines)


def _left_out(draft: Draft) -> Iterator[str]:
    """Columns that no channel takes, and what they tell."""
    if draft.proposal.unused:
        yield f"  not used: {', '.join(draft.proposal.unused)}"
    told, share = draft.untaken
    if told:
        names = draft.judged or ("y",)
        of = next(m.column for m in draft.proposal.matches if m.channel in names)
        yield (
            f"  of what the others leave of {of}, {', '.join(told)} "
            f"tell{'s' if len(told) == 1 else ''} {min(100 * share, 99):.0f} %: where that drives "
            'the machine, the model lacks an input: --model python --answer u.column="…, …" '
            "--answer y.column=… names all that drive (docs/how-to/model-of-your-own.md)"
        )


def _cut(question: str) -> tuple[str, str, str]:
    return question.partition(": ")
