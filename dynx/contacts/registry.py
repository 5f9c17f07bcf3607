"""Cases by name: those of dynx, of the running program, and of installed packages."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.contacts.case import Case
from dynx.errors import ArgumentError, UnknownNameError
from dynx.registry import ClassRegistry

GROUP = "dynx.contact_cases"
"""The entry-point group: ``name = "package.module:CaseClass"``."""

BUILT_IN = {
    "resting_force": "dynx.contacts.cases.resting_force:RestingForce",
    "resting_depth": "dynx.contacts.cases.resting_depth:RestingDepth",
    "slope": "dynx.contacts.cases.slope:Slope",
    "friction_isotropy": "dynx.contacts.cases.friction_isotropy:FrictionIsotropy",
    "rolling": "dynx.contacts.cases.rolling:Rolling",
    "sliding_to_rolling": "dynx.contacts.cases.sliding_to_rolling:SlidingToRolling",
    "rebound": "dynx.contacts.cases.rebound:Rebound",
    "free_momentum": "dynx.contacts.cases.free_momentum:FreeMomentum",
    "collision": "dynx.contacts.cases.collision:Collision",
    "newtons_cradle": "dynx.contacts.cases.newtons_cradle:NewtonsCradle",
    "spinning_ball": "dynx.contacts.cases.spinning_ball:SpinningBall",
    "bouncing_ball": "dynx.contacts.cases.bouncing_ball:BouncingBall",
    "restitution_pairs": "dynx.contacts.cases.restitution_pairs:RestitutionPairs",
    "friction_pairs": "dynx.contacts.cases.friction_pairs:FrictionPairs",
    "tipping_box": "dynx.contacts.cases.tipping_box:TippingBox",
    "pushed_box": "dynx.contacts.cases.pushed_box:PushedBox",
    "stack": "dynx.contacts.cases.stack:Stack",
    "driven_platform": "dynx.contacts.cases.driven_platform:DrivenPlatform",
    "standing_robot": "dynx.contacts.cases.standing_robot:StandingRobot",
    "spin_down": "dynx.contacts.cases.spin_down:SpinDown",
    "rolling_resistance": "dynx.contacts.cases.rolling_resistance:RollingResistance",
}
"""Cases of dynx itself, in the order of reports."""

_cases = ClassRegistry(
    "contact case", GROUP, BUILT_IN, lambda: Case, error=ArgumentError, unknown=UnknownNameError
)
case_names = _cases.names
register = _cases.register
unregister = _cases.unregister


def find_case(name: str) -> Case:
    """Return the case of that name; UnknownNameError where nobody provides it."""
    return _cases.find(name)()


def find_cases(names: Sequence[str] | None = None) -> tuple[Case, ...]:
    """Return the cases of these names, or all."""
    return tuple(find_case(name) for name in (case_names() if names is None else names))
