"""DX514 angle-cut-short: An angle is a multiple of pi/4 with only two or three decimals, such as 1.57.

``1.57`` is 0.0008 rad short of pi/2 and ``3.14`` 0.0016 rad short of pi: at the end of a one metre arm the
error is 0.8 and 1.6 mm, more than the repeatability of the robot. Axes that are parallel in the CAD model are
not parallel in the file, so closed-form inverse kinematics (IKFast, the formulas for a spherical wrist) finds
no solution or a wrong one. Reported are angles in the ``<origin>`` of a joint that are a multiple of pi/4, up
to a full turn, rounded or cut to two or three decimals.

All engines read the number unchanged.

What to do: write the angles in full, unless they were calibrated. ``dynx doctor --fix`` does so with
``--choose DX514=full``, which moves the links beyond the joint by that error, and by default keeps the
angles.
"""

import math
from collections.abc import Iterable

from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.joints import elements_in_joints


class AngleCutShort(OptionalEditingRule):
    advice = "Write angles in full: 1.5707963267948966."
    choices = {
        "keep": "keep the angles as they are written",
        "full": "write multiples of pi/4 in full",
    }
    changed = "wrote multiples of pi/4 in full"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints with such an angle in their origin."""
        for _, origin in elements_in_joints(case, "origin"):
            words = origin.attributes.get("rpy", "").split()
            short = [(word, angle) for word in words if (angle := _meant(word)) is not None]
            if short:
                word, angle = max(short, key=lambda pair: abs(float(pair[0]) - pair[1]))
                off = abs(float(word) - angle)
                message = f"rpy holds {word}, {off:.2g} rad from {angle!r}: {1e3 * off:.2g} mm at one metre"
                full = [word if (angle := _meant(word)) is None else repr(angle) for word in words]
                edit = case.source.attribute_edit(origin, "rpy", " ".join(full))
                yield correction(origin, message, edit)


def _meant(word: str) -> float | None:
    """Return the multiple of pi/4 of which `word` gives two or three decimals; None for other words."""
    digits = word.lstrip("+-")
    whole, point, decimals = digits.rstrip("0").partition(".")
    if not point or not (whole + decimals).isdigit() or not 2 <= len(digits.partition(".")[2]) <= 3:
        return None
    quarter = math.pi / 4.0
    count = round(float(digits) / quarter)
    if not 1 <= count <= 8:
        return None
    scale = 10.0 ** len(digits.partition(".")[2])
    shorts = (math.floor(scale * count * quarter), round(scale * count * quarter))
    if round(scale * float(digits)) not in shorts:
        return None
    return math.copysign(count * quarter, float(word))
