"""DX514 angle-cut-short: a quarter turn written as 1.57

``1.57`` is 0.0008 rad short of pi/2 and ``3.14`` 0.0016 rad short of pi: at the end of a one metre arm that
is 0.8 and 1.6 mm, more than the repeatability of the robot. Axes that are parallel in the CAD model are not
parallel in the file, so closed-form inverse kinematics (IKFast, the formulas for a spherical wrist) finds
no solution or a wrong one. Reported are angles in the ``<origin>`` of a joint that are a multiple of pi/4,
up to a full turn, rounded or cut to two or three decimals.

All engines read the number as it stands.

What to do: write the angles in full, unless they were calibrated. ``dynx doctor --fix`` does so with
``--choose DX514=full``, which moves the links behind the joint by that little, and by default keeps them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import ClassVar

from dynx.model.xml_source import SourceElement
from dynx.rules.case import Case
from dynx.rules.rule import Detection, Kind, Remedy, Rule


class AngleCutShort(Rule):
    """DX514."""

    id = "DX514"
    name = "angle-cut-short"
    title = "An angle is a multiple of pi/4 with only two or three decimals, such as 1.57."
    kind: ClassVar[Kind] = "practice"
    advice = "Write angles in full: 1.5707963267948966."
    choices: ClassVar[Mapping[str, str]] = {
        "keep": "keep the angles as they are written",
        "full": "write multiples of pi/4 in full",
    }

    def detect(self, case: Case) -> Sequence[Detection]:
        """Joints with such an angle in their origin."""
        found = []
        for name, origin in _origins(case):
            short = [(word, angle) for word in _words(origin) if (angle := _meant(word)) is not None]
            if short:
                word, angle = max(short, key=lambda pair: abs(float(pair[0]) - pair[1]))
                off = abs(float(word) - angle)
                message = f"rpy holds {word}, {off:.2g} rad from {angle!r}: {1e3 * off:.2g} mm at one metre"
                found.append(Detection(None, name, origin.line, message))
        return found

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """The angles in full, if that was chosen."""
        if self.chosen(case) != "full":
            return None
        joints = {detection.joint for detection in detections}
        edits = []
        for name, origin in _origins(case):
            if name in joints:
                words = [word if (angle := _meant(word)) is None else repr(angle) for word in _words(origin)]
                edits.append(case.source.setting(origin, "rpy", " ".join(words)))
        return Remedy(
            case.with_source(case.source.edited(*edits)),
            "wrote multiples of pi/4 in full",
            choice=self.decision(case),
            changes_physics=True,
        )


def _origins(case: Case) -> Iterator[tuple[str, SourceElement]]:
    for name, joint in case.joints.items():
        origin = joint.first("origin")
        if origin is not None:
            yield name, origin


def _words(origin: SourceElement) -> list[str]:
    return origin.attributes.get("rpy", "").split()


def _meant(word: str) -> float | None:
    """The multiple of pi/4 that `word` has two or three decimals of; None for every other word."""
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
