"""DX205 lower-limit-above-upper: The lower limit of a joint is above its upper limit.

The two ends were exchanged, or the sign of one was lost.

- Drake 1.51 refuses the file, with a message that shows a failed condition in Drake's C++ sources. It does so
  for continuous joints too, whose limits have no meaning.
- MuJoCo 4.0 and PyBullet 3.2.7 treat the joint as unlimited.
- Pinocchio 4.1 stores them unchanged, so random configurations and clamping go wrong.

The equations of motion do not depend on limits. dynx uses the smaller number as the lower limit.

What to do: correct the limits. ``dynx doctor --fix`` exchanges them. ``--choose DX205=unlimited`` writes the
largest double for both, as MuJoCo and PyBullet treat them.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import SINGLE, elements_in_joints
from dynx.rules.numbers_in_text import LARGEST


class LowerLimitAboveUpper(EditingRule):
    stage = "reading"
    advice = "Exchange the limits, or correct the one that is wrong."
    engines = measured_on("drake")
    choices = {
        "exchange": "exchange the two limits where the lower is above the upper",
        "unlimited": "write the largest double for both limits where the lower is above the upper",
    }
    changed = "exchanged lower and upper limits that were in the wrong order"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the limits of joints that move."""
        for _, limit in elements_in_joints(case, "limit", SINGLE):
            lower, upper = number_or_none(limit, "lower"), number_or_none(limit, "upper")
            if lower is None or upper is None or lower <= upper:
                continue
            if self.chosen(case) == "unlimited":
                written = (f"-{LARGEST}", LARGEST)
            else:
                written = (limit.attributes["upper"], limit.attributes["lower"])
            edit = case.source.attribute_edit
            edits = tuple(edit(limit, *each) for each in zip(("lower", "upper"), written, strict=True))
            yield correction(limit, f"the lower limit {lower:g} is above the upper {upper:g}", *edits)
