"""Settings of MuJoCo's solver and contacts, and their form in MuJoCo's model.

A contact of MuJoCo is a damped spring between accelerations: in it the bodies approach each other with
a = -b v - k r, whatever their masses (r is the distance, negative where they penetrate). dynx gives k and b
directly, for a natural frequency 1 / `time_constant` and a damping ratio that follows from the restitution of
the material. Of two materials MuJoCo takes the larger damping, thus the lower restitution, and the larger
coefficient of each kind of friction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from dynx.engines.mujoco.library import mujoco
from dynx.spatial.scalar import Floats
from dynx.world.settings import Setting

SETTINGS: Mapping[str, Setting] = {
    "integrator": Setting(
        "euler",
        "MuJoCo's integrator: semi-implicit Euler, or one that treats velocity-dependent forces implicitly",
        choices=("euler", "implicitfast", "implicit"),
    ),
    "solver": Setting("newton", "constraint solver", choices=("newton", "cg", "pgs")),
    "iterations": Setting(100, "largest number of iterations of the solver", 1),
    "tolerance": Setting(1e-10, "tolerance at which the solver stops", 0.0),
    "cone": Setting("elliptic", "friction cone", choices=("elliptic", "pyramidal")),
    "impratio": Setting(10.0, "ratio of the impedances of friction and normal force", 1e-6),
    "noslip_iterations": Setting(0, "iterations of the solver that removes slip", 0),
    "ccd_iterations": Setting(50, "largest number of iterations of convex collision detection", 1),
    "time_constant": Setting(
        0.005, "time constant of contacts and joint limits [s], at least two steps: smaller is stiffer", 1e-6
    ),
    "impedance": Setting(
        (0.9, 0.95, 0.001, 0.5, 2.0),
        "MuJoCo's solimp of contacts and joint limits: d_0, d_width, width [m or rad], midpoint, power",
    ),
    "margin": Setting(0.0, "distance [m] below which a contact is active", 0.0),
    "constraint_time_constant": Setting(
        0.005,
        "time constant of welds, point-to-point constraints, mimic joints and joint friction [s], "
        "at least two steps",
        1e-6,
    ),
    "constraint_impedance": Setting(
        (0.95, 0.99, 0.001, 0.5, 2.0),
        "MuJoCo's solimp of welds, point-to-point constraints and mimic joints",
    ),
    "joint_friction_impedance": Setting(
        0.999,
        "MuJoCo's solimp of joint friction, constant: joints that stick creep less the nearer it is to 1",
        0.0001,
        0.9999,
    ),
}
"""Settings by name; the defaults are dynx's canonical ones."""

SMALLEST_RESTITUTION = math.exp(-2.0)
"""Restitution of a critically damped contact, the least that a contact of MuJoCo has in dynx: 0.135."""

LARGEST_RESTITUTION = 0.999

_INTEGRATORS = {
    "euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
}
_SOLVERS = {
    "newton": mujoco.mjtSolver.mjSOL_NEWTON,
    "cg": mujoco.mjtSolver.mjSOL_CG,
    "pgs": mujoco.mjtSolver.mjSOL_PGS,
}
_CONES = {"elliptic": mujoco.mjtCone.mjCONE_ELLIPTIC, "pyramidal": mujoco.mjtCone.mjCONE_PYRAMIDAL}


def set_options(option: Any, settings: Mapping[str, Any], gravity: Floats, dt: float) -> None:
    """Write gravity, the step and the settings of the solver into MuJoCo's options.

    MuJoCo's reset after a divergence is disabled, because it would replace the state by another one, and so
    is its filter of parent and child, because the scene decides what collides.
    """
    option.timestep = dt
    option.gravity = gravity
    option.integrator = _INTEGRATORS[settings["integrator"]]
    option.solver = _SOLVERS[settings["solver"]]
    option.cone = _CONES[settings["cone"]]
    option.iterations = settings["iterations"]
    option.tolerance = settings["tolerance"]
    option.impratio = settings["impratio"]
    option.noslip_iterations = settings["noslip_iterations"]
    option.ccd_iterations = settings["ccd_iterations"]
    option.disableflags |= mujoco.mjtDisableBit.mjDSBL_AUTORESET | mujoco.mjtDisableBit.mjDSBL_FILTERPARENT


def contact_reference(settings: Mapping[str, Any], restitution: float, dt: float) -> tuple[float, float]:
    """Return MuJoCo's solref (-k, -b) of a contact with this restitution."""
    frequency = 1.0 / max(settings["time_constant"], 2.0 * dt)
    return -(frequency**2), -2.0 * damping_ratio(restitution) * frequency


def constraint_reference(settings: Mapping[str, Any], dt: float) -> tuple[float, float]:
    """Return MuJoCo's solref of welds, point-to-point constraints, mimic joints and joint friction."""
    return max(settings["constraint_time_constant"], 2.0 * dt), 1.0


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio, from 0 to 1, of a contact with this restitution.

    A body that touches a damped spring loses contact when the force has fallen to zero, before the spring is
    at its rest length (Schwager and Poeschel, Granular Matter 9, 2007, eq. 19); the ratio of the speeds is
    then exp(-2 z atan(s / z) / s) with s = sqrt(1 - z^2), which falls from 1 at z = 0 to exp(-2) at z = 1.
    """
    if restitution <= SMALLEST_RESTITUTION:
        return 1.0
    wanted, low, high = min(restitution, LARGEST_RESTITUTION), 0.0, 1.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        s = math.sqrt(1.0 - middle * middle)
        if math.exp(-2.0 * middle * math.atan2(s, middle) / s) > wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)
