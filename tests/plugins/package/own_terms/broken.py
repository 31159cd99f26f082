"""What an author may get wrong."""

from evertwin.machines.friction import Coefficient, FrictionTerm


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
