"""Models: the contract, parameters, kernels, wrappers. No particular machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.compiled.functions import OBSERVE as OBSERVE, STEP as STEP
    from evertwin.models.checks.model import check_model as check_model
    from evertwin.models.compiled import Compiled as Compiled
    from evertwin.models.contract import (
        BatchModel as BatchModel,
        KernelModel as KernelModel,
        LinearModel as LinearModel,
        Model as Model,
        PartialModel as PartialModel,
    )
    from evertwin.models.functions.function import (
        FunctionModel as FunctionModel,
        kernel_of as kernel_of,
        python_kernel as python_kernel,
    )
    from evertwin.models.kernels.kernel import Kernel as Kernel, Restart as Restart
    from evertwin.models.observing.observing import (
        hidden_of as hidden_of,
        observed as observed,
        unmeasured as unmeasured,
        remembers as remembers,
    )
    from evertwin.models.parameters import Parameter as Parameter, Parameters as Parameters
    from evertwin.models.kernels.rollout import roll as roll

__getattr__ = surface(__name__)
