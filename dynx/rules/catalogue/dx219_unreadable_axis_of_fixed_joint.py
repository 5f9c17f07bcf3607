"""DX219 unreadable-axis-of-fixed-joint: The axis of a joint that does not turn is not three numbers.

A fixed joint has no use for ``<axis>``, and exporters write ``<axis/>``, ``<axis xyz=""/>`` or what is left
of a template. A floating joint has none either.

- MuJoCo 4.0 reads the axis of every joint and refuses the file ("required attribute missing: 'xyz'", "bad
  format in attribute 'xyz'").
- Pinocchio 4.1, PyBullet 3.2.7 and Drake 1.51 ignore it. So does dynx.

A direction under another name, ``<axis xzy="0 0 1"/>``, is DX218.

What to do: remove the ``<axis>``. ``dynx doctor --fix`` does so.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import elements_in_joints, misspelled_direction, mujoco_reads


class UnreadableAxisOfFixedJoint(EditingRule):
    stage = "reading"
    advice = "Remove the <axis> of the joint."
    engines = measured_on("mujoco")
    changed = "removed unreadable axes of joints that have none"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of fixed and floating joints that MuJoCo cannot read."""
        for joint, axis in elements_in_joints(case, "axis", ("fixed", "floating")):
            if mujoco_reads(axis) or misspelled_direction(axis) is not None:
                continue
            text = axis.attributes.get("xyz")
            what = "no xyz" if text is None else f"xyz={shown(text)}"
            message = f"the <axis> of a {joint.attributes['type']} joint has {what}"
            yield correction(axis, message, case.source.removal(axis))
