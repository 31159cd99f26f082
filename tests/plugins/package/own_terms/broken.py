"""What an author may get wrong."""

from evertwin.machines.friction import Coefficient, FrictionTerm
from evertwin.models.form import Term
from evertwin.models.parameters import Parameter
from evertwin.models.terms.contract import SIMPLE, Candidate, CorrectionTerm, Functions
from evertwin.models.terms.kernel import placed


def steep(v, s, load, T, q, k):
    """Steeper than it says."""
    return 3.0 * v


def one(width, load, T, k):
    """Not enough."""
    return 1.0


def reads(v, s, load, T, q, k):
    """Depends on the load without saying so."""
    return s * load


def words(v, s, load, T, q, k):
    """Not a function of numbers."""
    return eval("v")


STEEP = FrictionTerm("steep", (Coefficient("a", "Nm", "N", steep, one),))
SILENT = FrictionTerm("silent", (Coefficient("b", "Nm", "N", reads, one),))
WORDS = FrictionTerm("words", (Coefficient("c", "Nm", "N", words, one),))
TAKEN = FrictionTerm("broken", (Coefficient("Fc", "Nm", "N", steep, one),))
BROKEN = "no term at all"


def half(at, grid, u, dt, p, x):
    """Not neutral at 0."""
    own = placed(at)
    u[own.channel] = 0.5 * u[own.channel] + p[0]
    return 0


class Half(CorrectionTerm):
    """A kind whose neutral value is none."""

    kind = "half"
    functions = Functions(half)

    def parameters(self, term, unit, source):
        return [Parameter("offset", 0.0, unit)]

    def propose(self, rows):
        yield Candidate(Term(self.kind, "v"), SIMPLE, ((0.1,),), (-1.0,), (1.0,), (0.1,))

    def say(self, term, values, unit, intervals):
        return "half"


class Beyond(Half):
    """A kind that starts beyond its bounds."""

    def propose(self, rows):
        yield Candidate(Term(self.kind, "v"), SIMPLE, ((3.0,),), (-1.0,), (1.0,), (0.1,))


class Silent(Half):
    """A kind that says nothing."""

    functions = Functions()

    def say(self, term, values, unit, intervals):
        return ""
