"""DX206 negative-effort-or-velocity: The largest effort or speed of a joint is negative.

Other formats use ``-1`` for "no limit"; otherwise the sign is a mistake.

- Pinocchio 4.1 refuses the file: "Some components of min_effort are greater than max_effort".
- Drake 1.51 refuses a negative velocity with a failed condition in its C++ sources. It ignores a negative
  effort unless a ``<transmission>`` gives the joint an actuator: then it refuses the file too, "which has a
  negative effort limit".
- PyBullet 3.2.7 reads both unchanged. MuJoCo 4.0 reads no velocity, and drops the sign of an effort.

The equations of motion do not depend on these limits. dynx reads the number with a note.

What to do: write the intended limits. ``dynx doctor --fix`` removes the sign. Where ``-1`` stands for "no
limit", ``--choose DX206=unlimited`` writes the largest double instead.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import SINGLE, elements_in_joints
from dynx.rules.numbers_in_text import LARGEST


class NegativeEffortOrVelocity(EditingRule):
    stage = "reading"
    advice = "Write a limit of at least 0."
    engines = measured_on("pinocchio", "drake")
    choices = {
        "absolute": "remove the sign of negative efforts and velocities",
        "unlimited": "write the largest double for negative efforts and velocities",
    }
    changed = "made the largest efforts and velocities of joints positive"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the limits of joints that move."""
        for _, limit in elements_in_joints(case, "limit", SINGLE):
            below = [name for name in ("effort", "velocity") if (number_or_none(limit, name) or 0.0) < 0.0]
            if below:
                listed = " and ".join(f"{name}={limit.attributes[name].strip()}" for name in below)
                edits = tuple(
                    case.source.attribute_edit(limit, name, self._correct(case, limit.attributes[name]))
                    for name in below
                )
                yield correction(limit, f"<limit> has {listed}", *edits)

    def _correct(self, case: Case, written: str) -> str:
        return LARGEST if self.chosen(case) == "unlimited" else written.strip().removeprefix("-")
