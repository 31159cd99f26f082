"""The filter that goes over measurement and prediction alike, as a twin file says it.

>>> from evertwin.config.spec import ClockSpec, FilterSpec, ModelSpec
>>> clock, rule = ClockSpec(rate=100.0), FilterSpec(cutoff=5.0)
>>> spec = TwinSpec("a", ModelSpec("drive"), clock=clock, filter=rule)
>>> low_pass(spec).delay > 0
True
"""

from __future__ import annotations

from evertwin.config import TwinSpec
from evertwin.errors import ConfigError
from evertwin.signals.fir import Symmetric


def low_pass(spec: TwinSpec) -> Symmetric:
    """The filter of ``[filter]``.

    Raises:
        ConfigError: the twin file gives no filter, or no rate.
    """
    rule, rate = spec.filter, spec.clock.rate
    if rule is None:
        raise ConfigError('[[derive]] op = "filter": expected a [filter] section that says which')
    if rate is None:
        raise ConfigError("[filter]: a filter needs rows at a fixed rate: set rate in [clock]")
    if rule.kind == "butterworth":
        return Symmetric.butterworth(rule.cutoff, rate, rule.order)
    return Symmetric.savgol(2 * round(min(0.5 * rate / rule.cutoff, 1e9)) + 1, rule.order)
