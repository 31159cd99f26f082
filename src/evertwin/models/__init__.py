"""Models: the contract, parameters, kernels, wrappers. No particular machine."""

from __future__ import annotations

from typing import TYPE_CHECKING

from evertwin.surface import surface

if TYPE_CHECKING:
    from evertwin.compiled.functions import OBSERVE, STEP
    from evertwin.models.check import check_model
    from evertwin.models.compiled import Compiled
    from evertwin.models.contract import BatchModel, KernelModel, LinearModel, Model, PartialModel
    from evertwin.models.function import FunctionModel, kernel_of, python_kernel
    from evertwin.models.kernel import Kernel, Restart
    from evertwin.models.parameters import Parameter, Parameters
    from evertwin.models.rollout import roll

__all__ = [
    "OBSERVE",
    "STEP",
    "BatchModel",
    "Compiled",
    "FunctionModel",
    "Kernel",
    "KernelModel",
    "LinearModel",
    "Model",
    "Parameter",
    "Parameters",
    "PartialModel",
    "Restart",
    "check_model",
    "kernel_of",
    "python_kernel",
    "roll",
]

__getattr__ = surface(__name__)
