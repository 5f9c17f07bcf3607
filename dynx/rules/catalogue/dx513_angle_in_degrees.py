"""DX513 angle-in-degrees: An angle seems to be written in degrees, where URDF reads radians.

Two patterns are reported. An ``rpy`` angle beyond a full turn, 6.28 rad: no orientation is written so, while
10, 45, 90 and 180 are usual in degrees. And the limits of a revolute joint that are both whole multiples of 5
between -360 and 360, at least one of them 30 or more: 30 rad are five turns, and 30 degrees is a usual range.
Limits of -100 and 100 are not reported, because they often stand for "unlimited".

All engines read radians: 90 is 14.3 turns. They agree, but on a robot with wrong poses or joints without
effective stops.

That the unit is degrees is a guess, so no edit removes the cause; the message gives the value in radians.
"""

import math
from collections.abc import Iterable, Iterator

from dynx.errors import DescriptionError
from dynx.model.urdf.elements import FULL_TURN
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Detection, Rule, found_at
from dynx.rules.attributes import origin_of

_STEP, _SMALLEST, _LARGEST = 5.0, 30.0, 360.0
_UNLIMITED = (-100.0, 100.0)


class AngleInDegrees(Rule):
    kind = "practice"
    advice = "Write the angle in radians."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield ``<origin>``s with such an angle and revolute joints with such limits."""
        return sorted([*_origins(case), *_limits(case)], key=lambda detection: detection.line or 0)


def _origins(case: Case) -> Iterator[Detection]:
    for part in case.source.root.children:
        if part.tag not in ("link", "joint"):
            continue
        for element in part.walk():
            if element.tag != "origin" or element.parent is None:
                continue
            large = [angle for angle in _angles(element.parent) if abs(angle) > FULL_TURN]
            if large:
                message = f"rpy holds {large[0]:g}, read as radians; in degrees it is {_radians(large[0])}"
                yield found_at(element, message)


def _limits(case: Case) -> Iterator[Detection]:
    for joint in case.model.joints:
        ends = (joint.limits.lower, joint.limits.upper)
        if joint.type != "revolute" or tuple(sorted(ends)) == _UNLIMITED:
            continue
        degrees = all(abs(end) <= _LARGEST and end % _STEP == 0.0 for end in ends)
        if degrees and max(map(abs, ends)) >= _SMALLEST:
            message = (
                f"the limits {ends[0]:g} and {ends[1]:g} are read as radians; "
                f"in degrees they are {_radians(ends[0])} and {_radians(ends[1])}"
            )
            limit = case.joints[joint.name].first("limit")
            yield Detection(None, joint.name, joint.line if limit is None else limit.line, message)


def _angles(parent: SourceElement) -> tuple[float, ...]:
    try:
        return origin_of(parent).rpy
    except DescriptionError:  # of a <visual>, which dynx.load does not read
        return ()


def _radians(angle_deg: float) -> str:
    return repr(math.radians(angle_deg))
