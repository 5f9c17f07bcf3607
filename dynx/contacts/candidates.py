"""Settings of each engine to which an error may be attributed, in the order in which they are tried."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from dynx.argument_types import checks_types

SUBSTEPS = "substeps"
"""Number of steps of the engine in each step, an option of every world that counts as a setting here."""


@checks_types
@dataclass(frozen=True)
class SettingsChange:
    """Changes of one setting of an engine, or of several at once, tried one after the other.

    `values` has the same number of values for each setting, each farther from the default than the one
    before. If the first setting has positive numbers, it may make an error fall in proportion. Any other
    setting has to remove the error.
    """

    values: Mapping[str, tuple[Any, ...]]
    reason: str
    """Effect of the setting in the engine, as a sentence."""

    @property
    def changes(self) -> list[dict[str, Any]]:
        """Settings that are changed together, one dict for each change."""
        rows = zip(*self.values.values(), strict=True)
        return [dict(zip(self.values, row, strict=True)) for row in rows]


CANDIDATES: Mapping[str, tuple[SettingsChange, ...]] = {
    "pybullet": (
        SettingsChange(
            {"contact_distance": (0.002, 0.0002)},
            "Bullet keeps contacts of shapes that are still apart, and stops their approach there.",
        ),
        SettingsChange(
            {"restitution_speed": (0.005, 0.0005)},
            "Bullet lets no impact rebound that is slower than this speed.",
        ),
        SettingsChange(
            {"contact_slop": (2e-6, 0.0)},
            "Bullet leaves penetrations that are no deeper than this.",
        ),
        SettingsChange(
            {"contact_erp": (0.01, 0.0)},
            "Bullet pushes shapes that penetrate apart by this share in every step, which adds speed.",
        ),
        SettingsChange(
            {"residual_threshold": (1e-12, 0.0), "solver_iterations": (400, 2000)},
            "Bullet's solver of impulses is iterative and stops at this residual or number of iterations.",
        ),
        SettingsChange(
            {"friction_anchors": (True,)},
            "Bullet lets contacts that stick creep, unless it draws them back to where they formed.",
        ),
        SettingsChange(
            {"contact_erp": (0.0,), "contact_slop": (0.0,)},
            "Bullet changes the speed of an impact by the depth that is beyond the slop.",
        ),
        SettingsChange(
            {"contact_distance": (0.0,), "contact_erp": (0.0,), "contact_slop": (0.0,)},
            "Bullet slows shapes before they touch, pushes those apart that penetrate, and lets them "
            "approach to the slop; all three change the speed of a rebound.",
        ),
        SettingsChange(
            {SUBSTEPS: (8,)},
            "The error falls with the step of the engine, too little between the steps that were run.",
        ),
        SettingsChange(
            {"contact_slop": (0.0,), SUBSTEPS: (8,)},
            "Bullet leaves penetrations that are no deeper than the slop, and deeper ones in long steps.",
        ),
        SettingsChange(
            {
                "cone_friction": (False,),
                "contact_erp": (0.0,),
                "residual_threshold": (0.0,),
                "solver_iterations": (2000,),
            },
            "The friction cone of Bullet is used up by directions in which joints let nothing move; its "
            "solver is iterative, and pushes apart what penetrates.",
        ),
    ),
    "mujoco": (
        SettingsChange(
            {"time_constant": (0.0035, 0.002)},
            "A contact of MuJoCo is a damped spring with this time constant.",
        ),
        SettingsChange(
            {"time_constant": (0.02, 0.05)},
            "A contact of MuJoCo is a damped spring, which the step resolves the better, the softer it is.",
        ),
        SettingsChange(
            {"slip_time_constant": (0.005, 0.002, 0.001)},
            "Slip of a contact of MuJoCo decays with this time constant.",
        ),
        SettingsChange(
            {SUBSTEPS: (8,)},
            "The error falls with the step of the engine, too little between the steps that were run.",
        ),
        SettingsChange(
            {
                "impedance": ((0.02, 0.9, 1.0, 0.5, 2.0),),
                "time_constant": (1e-6,),
                SUBSTEPS: (8,),
            },
            "Friction of MuJoCo pushes bodies apart that slide, so that they hop and yaw on their corners, "
            "unless contacts give way under the weight by more than this push.",
        ),
        SettingsChange(
            {"slip_time_constant": (0.1, 1.0), SUBSTEPS: (1, 8)},
            "Friction of MuJoCo opposes slip within this time: the shorter it is, the more its contacts, "
            "which are convex problems, push bodies apart that slide.",
        ),
        SettingsChange(
            {"slip_time_constant": (1e-3, 1e-6), SUBSTEPS: (8, 16)},
            "Friction of MuJoCo opposes slip within this time, or a step, which is too long for an impact.",
        ),
        SettingsChange(
            {"impratio": (1e3, 1e4)},
            "MuJoCo's friction is a soft constraint, stiffer than the normal force by this ratio.",
        ),
        SettingsChange(
            {"noslip_iterations": (5, 50)},
            "MuJoCo's friction is soft and lets contacts creep, unless this solver removes the slip.",
        ),
        SettingsChange(
            {"impedance": ((0.99, 0.99, 0.001, 0.5, 2.0), (0.9999, 0.9999, 0.001, 0.5, 2.0))},
            "MuJoCo's constraints reach this share of the acceleration that they aim at.",
        ),
        SettingsChange(
            {"time_constant": (0.002, 0.001), SUBSTEPS: (16, 64)},
            "A contact of MuJoCo is a damped spring. Gravity acts while it is loaded, and a stiffer one "
            "needs shorter steps.",
        ),
        SettingsChange(
            {
                "impedance": ((0.02, 0.9, 1.0, 0.5, 2.0),),
                "time_constant": (1e-6,),
                "slip_time_constant": (0.003,),
                SUBSTEPS: (8,),
            },
            "Friction of MuJoCo pushes bodies apart that slide, unless contacts give way, and is below its "
            "limit where slip would end within its time constant.",
        ),
    ),
    "drake": (
        SettingsChange(
            {"stiction_tolerance": (1e-5, 1e-6)},
            "Friction of Drake grows with the sliding speed up to this speed, so that bodies creep.",
        ),
        SettingsChange(
            {"stiffness": (1e7, 1e8)},
            "A point contact of Drake is a spring of this stiffness.",
        ),
        SettingsChange(
            {"modulus": (1e9, 1e10)},
            "A surface contact of Drake has a pressure in proportion to this modulus.",
        ),
        SettingsChange(
            {"dissipation": (100.0, 1000.0)},
            "Contacts of Drake dissipate in proportion to this factor: the less, the more a body rebounds.",
        ),
        SettingsChange(
            {"contact_approximation": ("similar",)},
            "Drake limits friction by the normal force at the beginning of a step, which may be far larger "
            "than the one that acts, unless it is told to use that.",
        ),
        SettingsChange(
            {"modulus": (1e7, 1e6)},
            "Boxes that slide in Drake chatter where contacts over surfaces are too stiff for the step, and "
            "friction is then too large.",
        ),
        SettingsChange(
            {"contact_model": ("point",)},
            "In Drake's contacts over surfaces a cylinder is a prism, which does not roll like a circle.",
        ),
        SettingsChange(
            {"contact_approximation": ("sap",)},
            "Drake approximates friction and dissipation within a step in this manner.",
        ),
        SettingsChange(
            {"modulus": (1e9, 1e10), SUBSTEPS: (4, 16)},
            "A surface contact of Drake has a pressure in proportion to this modulus; a stiffer one needs "
            "shorter steps.",
        ),
    ),
}
"""Settings by engine to which errors may be attributed. Errors of other engines that do not fall are
unexplained."""
