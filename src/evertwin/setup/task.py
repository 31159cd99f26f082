"""What slow work is asked for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from evertwin.fold import Windows
from evertwin.models.form import Version


class Doubt(NamedTuple):
    """A channel that was said to be read wrongly.

    >>> Doubt().channel
    ''
    """

    channel: str = ""
    """Empty: none."""
    number: float = 1.0
    """Recorded over what it was said to be; 1: off by a constant, a share, or exchanged."""
    row: int = 0
    """Row after those that say so: later ones alone can refute it."""


class Task(NamedTuple):
    """What a request asks for, with all that the answer follows from.

    >>> Task._fields
    ('kind', 'version', 'windows', 'tunings', 'held', 'waits', 'rival', 'commissioned',
    'cause', 'earlier', 'replaced', 'doubt', 'former', 'rose', 'seen', 'stayed',
    'scheduled', 'untold')
    """

    kind: str
    """``fit``, ``retell``, ``correct``; ``state``: a state alone; ``refine``: the version's."""
    version: Version
    """What it starts from."""
    windows: Windows
    tunings: int
    """Tunings so far: the schedule's position."""
    held: bool = False
    """Has the version been found within the requirement, or off by as much all the while until it
    rose? Then it may be the machine that changed. One that never held may be wrong in another way
    at each speed, which looks alike."""
    waits: bool = False
    """Is it asked again when more rows are there, should these say too little?"""
    rival: Version | None = None
    """A candidate has to surpass it: what is on trial meanwhile, or what is live."""
    commissioned: bool = False
    """Do numbers that are tuned once stay?"""
    cause: str = ""
    """Cause that a person named, which is tried first."""
    earlier: Windows = ()
    """Rows that are kept from before these: how channels usually go."""
    replaced: Version | None = None
    """The one before the version, by rows that neither had seen."""
    doubt: Doubt = Doubt()
    former: tuple[Version, ...] = ()
    """The newest that were live before the version: a repair may bring one of them back."""
    rose: int = 0
    """Row from which on it may be another machine; 0: from any on."""
    seen: np.ndarray | None = None
    """Lowest and highest value of each input on rows before all these that the version ran on."""
    stayed: np.ndarray | None = None
    """How long each input stayed where it was, over all rows (`evertwin.rows.stayed`)."""
    scheduled: bool = False
    """Is it asked without a deviation? Then it is of the parameters whose turn it is."""
    untold: Version | None = None
    """The newest before the version of which it was not said that a sensor would look the same;
    None: the version itself."""
