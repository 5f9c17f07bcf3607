"""Settings of Bullet's solver and contacts, with dynx's defaults."""

from __future__ import annotations

from dynx.steppers.materials import STRICT_MATERIALS
from dynx.steppers.settings import Setting

SETTINGS = {
    "solver_iterations": Setting(
        100, "largest number of iterations of the constraint solver", least=1, most=1e6
    ),
    "residual_threshold": Setting(1e-7, "squared residual at which the solver stops iterating"),
    "erp": Setting(0.2, "share of the error of constraints and joint limits removed in a step", most=1.0),
    "contact_erp": Setting(0.05, "share of a penetration removed in a step", most=1.0),
    "friction_erp": Setting(0.2, "share of the drift of a sticking contact removed in a step", most=1.0),
    "cone_friction": Setting(True, "whether friction is limited by a cone, not by a pyramid"),
    "restitution_speed": Setting(0.05, "least approach speed [m/s] of an impact that rebounds"),
    "rebound_time_constant": Setting(
        0.2, "time constant [s] of the removal of penetrations between surfaces that rebound", most=1e6
    ),
    "contact_distance": Setting(0.02, "distance [m] below which contact points are kept"),
    "contact_slop": Setting(1e-5, "depth [m] to which a penetration is not removed", most=1.0),
    "mesh_margin": Setting(0.0, "distance [m] by which the hull of a mesh is enlarged", most=1.0),
    "constraint_force": Setting(1e6, "largest force [N] or moment [N m] of welds and points", most=1e12),
    "strict_materials": STRICT_MATERIALS,
}
"""Settings by name."""

PARAMETERS = {
    "solver_iterations": "numSolverIterations",
    "residual_threshold": "solverResidualThreshold",
    "erp": "erp",
    "contact_erp": "contactERP",
    "friction_erp": "frictionERP",
    "cone_friction": "enableConeFriction",
    "restitution_speed": "restitutionVelocityThreshold",
    "contact_distance": "contactBreakingThreshold",
    "contact_slop": "contactSlop",
}
"""Names in `setPhysicsEngineParameter` of the settings that it takes."""
