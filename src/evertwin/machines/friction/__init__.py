"""Friction of a drive: a law is a sum of terms, every one linear in its coefficients.

With the velocity ``v`` and a switch ``s(v)``, which is ``sign v`` outside a standstill or
``tanh(v / width)``, the terms that come with the package make

    f = Fv·v + Fv_back·min(v, 0) + offset + s(v)·(Fc + Fs·exp(−(v / vs)²) + Fr·√|v| + Fl·|load|)

and what depends on position or temperature, one in each file of `terms`. Viscous and Coulomb
friction and a constant are in every law; a law names the others, joined by ``+``, and the ladder of
them is climbed only while the error on unseen data falls. Another package adds a term of its own
under the entry point ``evertwin.friction``: one `FrictionTerm`, checked by `check_friction`, and
every machine that has friction takes it.

>>> from evertwin.machines.friction import Law
>>> law = Law.parse("tanh+stribeck+load")
>>> [item.name for item in law.parameters(suffix="3")]
['Fv3', 'Fc3', 'offset3', 'Fs3', 'Fl3', 'vs3', 'width3']
>>> str(law)
'tanh+stribeck+load'
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.machines.friction.contract import (
        Coefficient as Coefficient,
        FrictionTerm as FrictionTerm,
        Shape as Shape,
    )
    from evertwin.machines.friction.law import (
        Law as Law,
        Rubbing as Rubbing,
        Rung as Rung,
        shape_of as shape_of,
    )

__getattr__ = surface(__name__)
