"""DX226 axis-nearly-aligned: A joint axis is off a coordinate axis by less than 2e-8 rad, which some engines
drop.

CAD programs export axes with noise, such as ``0 1 1.2e-12`` or ``1.6e-10 0 1``. Engines have faster joints
for axes along x, y and z, and choose them by comparing the axis with a tolerance.

- Drake 1.51.1 takes the coordinate axis where a component of the unit axis rounds to more than 1 - 2.2e-16,
  that is, where the deviation is below about 1.8e-8 rad; for revolute, continuous and prismatic joints.
- Pinocchio 4.1.0 takes it up to a deviation of 1e-12.
- Both compare with the positive directions only: ``1.6e-10 0 -1`` is used as it stands.
- PyBullet 3.2.7 and MuJoCo 4.0.0 use all numbers. So does dynx.

The effect is the angle: poses, and with them torques, are off by up to twice that angle at every joint.

What to do: write the coordinate axis, which is meant. ``dynx doctor --fix`` writes it, and the report says
that the physics changed, by less than 2e-8; ``--choose DX226=keep`` leaves the axis.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from dynx.model.elements import Joint
from dynx.rules import Case, Correction, Detection, EditingRule, Remedy, measured_on
from dynx.rules.joints import SINGLE, axis_edit, elements_in_joints
from dynx.rules.rule import found_at

AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}

DRAKE_DEVIATION = 1.825e-8
"""Deviation [rad] from a coordinate axis below which Drake takes that axis."""

PINOCCHIO_DEVIATION = 1e-12
"""Deviation [rad] from a coordinate axis up to which Pinocchio takes that axis."""

_NEGLIGIBLE = 1e-14
"""Deviation [rad] that is not reported: rounding of a unit vector, with no effect."""


class AxisNearlyAligned(EditingRule):
    engines = measured_on("pinocchio", "drake")
    advice = "Write the coordinate axis."
    choices = {
        "align": "write the coordinate axis for axes off it by less than 2e-8 rad; this changes the physics",
        "keep": "leave such axes as they are",
    }
    changed = "wrote the coordinate axis for joint axes that were off it by less than 2e-8 rad"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the axes of revolute, continuous and prismatic joints."""
        for element, axis in elements_in_joints(case, "axis", SINGLE):
            joint = case.model.joint(element.attributes["name"])
            name, deviation = nearest_axis(joint)
            if not _NEGLIGIBLE < deviation < DRAKE_DEVIATION:
                continue
            message = f"the axis is {deviation:.2g} rad off {name}"
            engines = ["Drake"] if deviation > PINOCCHIO_DEVIATION else ["Pinocchio", "Drake"]
            clauses = tuple((engine.lower(), f"exactly {name} in {engine}") for engine in engines)
            found = replace(found_at(axis, message), engine_clauses=clauses)
            yield Correction(found, (axis_edit(case.source, element, AXES[name]),))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Write the coordinate axes, unless the user chose to keep the numbers."""
        return None if self.chosen(case) == "keep" else super().remedy(case, detections)


def nearest_axis(joint: Joint) -> tuple[str, float]:
    """Find the coordinate axis nearest to the axis of a joint, and the deviation [rad] from it."""
    name, largest = max(zip(AXES, joint.axis, strict=True), key=lambda pair: pair[1])
    others = [value for each, value in zip(AXES, joint.axis, strict=True) if each != name]
    return name, math.atan2(math.hypot(*others), largest)
