"""What a rigid body can be: mass above zero, and principal moments that some shape could have.

>>> checked("link 'rod'", 2.0, np.diag([0.1, 0.1, 0.01]))
()
>>> checked("link 'rod'", 2.0, np.diag([0.1, 0.1, 0.5]))[0]
"link 'rod' has principal moments 0.1, 0.1, 0.5 kg m²: no body has one above the sum of the others"
"""

from __future__ import annotations

import numpy as np

from evertwin.errors import ModelError
from evertwin.machines.arm.inertia import Matrix


def checked(at: str, mass: float, inertia: Matrix | None) -> tuple[str, ...]:
    """Remarks about a body; ``inertia`` about its centre [kg m²], None for a point.

    Raises:
        ModelError: no machine can be so; opens with ``at``.
    """
    if not (mass > 0.0 and np.isfinite(mass)):
        raise ModelError(f"{at} has mass {mass:g} kg, expected > 0: a frame has no <inertial>")
    if inertia is None:
        return ()
    principal = np.linalg.eigvalsh(inertia)
    shown = ", ".join(f"{v:.3g}" for v in principal)
    if not principal[0] > 0.0:
        raise ModelError(
            f"{at} has an inertia with principal values {shown} kg m², expected all > 0: check "
            "ixx … izz"
        )
    if principal[2] > (principal[0] + principal[1]) * (1.0 + 1e-6):
        return (
            f"{at} has principal moments {shown} kg m²: no body has one above the sum of the "
            "others",
        )
    return ()
