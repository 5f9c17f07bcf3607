"""Angles and quaternions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

from dynx.errors import DescriptionError, shown
from dynx.model.urdf.reader import FULL_TURN, QUATERNION
from dynx.model.xml.source import SourceElement
from dynx.rules import (
    EVERY_ENGINE,
    Case,
    Correction,
    Detection,
    EditingRule,
    Rule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import orientation_edits, origin_of, quaternions_count
from dynx.rules.joints import elements_in_joints
from dynx.rules.numbers_in_text import decimal, is_plain, origins_with_quaternion, quaternion_rpy


class OrientationAsQuaternion(EditingRule):
    """DX418 orientation-as-quaternion: The orientation of an origin is a quaternion, which few engines read.

    URDF 1.1 introduced ``<origin xyz="..." quat_xyzw="0 0 0.7071 0.7071"/>`` in place of ``rpy``. The
    quaternion has a meaning only in a file with ``<robot version="1.1">`` or ``1.2``. In other files every
    engine ignores it, see DX530.

    - Pinocchio 4.1 and dynx read the quaternion, and scale it to length 1.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore the attribute without a warning: the origin has no
      rotation.

    The effect: if the origin is that of a joint, the positions of all links beyond this place have a relative
    error of order 1. If it is that of an ``<inertial>``, the mass matrix has such an error.

    What to do: write the orientation as ``rpy``, with all digits. ``dynx doctor --fix`` computes ``rpy`` from
    the quaternion. The orientation is the same to rounding.
    """

    stage = "reading"
    advice = "Write the orientation as rpy with all digits."
    engines = measured_on("pybullet", "mujoco", "drake")
    changed = "wrote quaternions of origins as roll, pitch and yaw"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with a quaternion that Pinocchio reads as a rotation."""
        for origin in origins_with_quaternion(case):
            rpy = quaternion_rpy(origin)
            if rpy is None or not quaternions_count(origin):
                continue
            if "rpy" in origin.attributes or not is_plain(case, origin):
                continue
            message = (
                f"the orientation is {QUATERNION}={origin.attributes[QUATERNION]!r}, "
                f'which is rpy="{" ".join(map(decimal, rpy))}"'
            )
            yield correction(origin, message, *orientation_edits(case.source, origin, rpy))


class UnreadableQuaternion(EditingRule):
    """DX419 unreadable-quaternion: The quaternion of an origin is invalid, or the origin also has ``rpy``.

    From URDF 1.1, ``quat_xyzw`` holds four numbers separated by blanks, not all zero. An origin with
    ``quat_xyzw`` must not have ``rpy``. Of the four engines, only Pinocchio reads the quaternion (DX418).

    - Pinocchio 4.1 refuses the file if the origin is that of a ``<joint>``. In an ``<inertial>`` it drops the
      whole inertial with a line on stderr, so the link has no mass. It reads a quaternion of length 0 as no
      rotation, without a warning.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 use ``rpy``. Without ``rpy`` the origin has no rotation.

    dynx refuses such an origin, and names the line.

    What to do: write one orientation, as ``rpy``. If the origin has an ``rpy``, ``dynx doctor --fix`` keeps
    it and removes the quaternion. If commas or tabs separate the four numbers, it converts the quaternion to
    ``rpy``. Otherwise it removes the quaternion. The origin then has no rotation, as in PyBullet, MuJoCo and
    Drake.
    """

    stage = "reading"
    advice = "Write one orientation, as rpy."
    engines = EVERY_ENGINE
    changed = "removed quaternions that are no rotation or stand beside rpy, or wrote them as rpy"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with such a quaternion."""
        for origin in origins_with_quaternion(case):
            if not quaternions_count(origin):
                continue
            text = shown(origin.attributes[QUATERNION])
            rpy = quaternion_rpy(origin)
            edits = [case.source.attribute_removal(origin, QUATERNION)]
            if "rpy" in origin.attributes:
                message = f"<origin> has both rpy and {QUATERNION}={text}"
            elif rpy is None:
                message = f"{QUATERNION} is {text}; wanted four numbers that are not all zero"
            elif not is_plain(case, origin):
                message = f"the numbers of {QUATERNION}, {text}, are not separated by blanks alone"
                edits = orientation_edits(case.source, origin, rpy)
            else:
                continue
            yield correction(origin, message, *edits)


_DEGREE_STEP, _SMALLEST_DEGREES, _LARGEST_DEGREES = 5.0, 30.0, 360.0
_UNLIMITED_ENDS = (-100.0, 100.0)


class AngleInDegrees(Rule):
    """DX513 angle-in-degrees: An angle seems to be written in degrees, where URDF reads radians.

    The rule reports two patterns. First, an ``rpy`` angle is above a full turn, 6.28 rad. Nobody writes such
    an orientation in radians, but 10, 45, 90 and 180 are usual in degrees. Second, both limits of a revolute
    joint are multiples of 5 between -360 and 360, and at least one of them is 30 or more. 30 degrees is a
    usual limit, but 30 rad are five turns. The rule does not report limits of -100 and 100, because they
    often mean "unlimited".

    All engines read radians: 90 is 14.3 turns. So all engines agree on wrong poses, or on wrong limits.

    The rule only guesses that the unit is degrees, so no edit removes the cause. The message gives the value
    in radians.
    """

    kind = "practice"
    advice = "Write the angle in radians."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield ``<origin>``s with such an angle and revolute joints with such limits."""
        return sorted(
            [*_degrees_in_origins(case), *_degrees_in_limits(case)], key=lambda detection: detection.line or 0
        )


def _degrees_in_origins(case: Case) -> Iterator[Detection]:
    for part in case.source.root.children:
        if part.tag not in ("link", "joint"):
            continue
        for element in part.walk():
            if element.tag != "origin" or element.parent is None:
                continue
            large = [angle for angle in _angles_of(element.parent) if abs(angle) > FULL_TURN]
            if large:
                message = f"rpy holds {large[0]:g}, read as radians; in degrees it is {_radians(large[0])}"
                yield found_at(element, message)


def _degrees_in_limits(case: Case) -> Iterator[Detection]:
    for joint in case.model.joints:
        ends = (joint.limits.lower, joint.limits.upper)
        if joint.type != "revolute" or tuple(sorted(ends)) == _UNLIMITED_ENDS:
            continue
        degrees = all(abs(end) <= _LARGEST_DEGREES and end % _DEGREE_STEP == 0.0 for end in ends)
        if degrees and max(map(abs, ends)) >= _SMALLEST_DEGREES:
            message = (
                f"the limits {ends[0]:g} and {ends[1]:g} are read as radians; "
                f"in degrees they are {_radians(ends[0])} and {_radians(ends[1])}"
            )
            limit = case.joints[joint.name].first("limit")
            yield Detection(None, joint.name, joint.line if limit is None else limit.line, message)


def _angles_of(parent: SourceElement) -> tuple[float, ...]:
    try:
        return origin_of(parent).rpy
    except DescriptionError:  # of a <visual>, which dynx.load does not read
        return ()


def _radians(angle_deg: float) -> str:
    return repr(math.radians(angle_deg))


class AngleCutShort(EditingRule):
    """DX514 angle-cut-short: An angle is a multiple of pi/4 with only two or three decimals, such as 1.57.

    ``1.57`` is 0.0008 rad less than pi/2, and ``3.14`` is 0.0016 rad less than pi. At the end of an arm of 1
    m the error is 0.8 mm or 1.6 mm, more than the repeatability of usual robots. Axes that are parallel in
    the CAD model are then not parallel in the file. So closed-form inverse kinematics (IKFast, the formulas
    for a spherical wrist) finds no solution, or a wrong solution. The rule examines angles in the
    ``<origin>`` of a joint. It reports multiples of pi/4, up to a full turn, that were rounded or truncated
    to two or three decimals.

    All engines read the number unchanged.

    What to do: write the angles with all digits, unless they were calibrated. By default
    ``dynx doctor --fix`` keeps the angles. With ``--choose DX514=full`` it writes all digits, which moves the
    links beyond the joint by this error.
    """

    kind = "practice"
    advice = "Write angles with all digits: 1.5707963267948966."
    choices = {
        "keep": "keep the angles as they are written",
        "full": "write multiples of pi/4 with all digits",
    }
    changed = "wrote multiples of pi/4 in full"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints with such an angle in their origin."""
        for _, origin in elements_in_joints(case, "origin"):
            words = origin.attributes.get("rpy", "").split()
            short = [(word, angle) for word in words if (angle := _multiple_meant(word)) is not None]
            if short:
                word, angle = max(short, key=lambda pair: abs(float(pair[0]) - pair[1]))
                off = abs(float(word) - angle)
                message = f"rpy holds {word}, {off:.2g} rad from {angle!r}: {1e3 * off:.2g} mm at one metre"
                full = [word if (angle := _multiple_meant(word)) is None else repr(angle) for word in words]
                edit = case.source.attribute_edit(origin, "rpy", " ".join(full))
                yield correction(origin, message, edit)


def _multiple_meant(word: str) -> float | None:
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


class QuaternionWithoutVersion(EditingRule):
    """DX530 quaternion-without-version: An origin has a quaternion, but the robot states no version that
    reads it.

    ``<origin quat_xyzw="..."/>`` is part of URDF 1.1 and 1.2. Without ``<robot version="1.1">`` (or 1.2) a
    file has version 1.0. Then every engine ignores the quaternion without a warning. So all engines agree:
    the origin has the rotation of ``rpy``, or no rotation.

    What to do: write the orientation as ``rpy``, which every engine reads. By default ``dynx doctor --fix``
    leaves the file as it is. With ``--choose DX530=rpy`` it writes the quaternion as ``rpy``, which changes
    the robot. If you only add the version, Pinocchio reads the quaternion, but the other engines do not
    (DX418).
    """

    kind = "practice"
    stage = "reading"
    advice = "Write the orientation as rpy."
    choices = {
        "keep": "leave quaternions that every engine ignores as they are",
        "rpy": "write quaternions that every engine ignores as roll, pitch and yaw",
    }
    changed = "wrote ignored quaternions of origins as roll, pitch and yaw"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield origins with a quaternion in a robot of URDF 1.0."""
        for origin in origins_with_quaternion(case):
            if quaternions_count(origin):
                continue
            rpy = quaternion_rpy(origin)
            edits = [] if rpy is None else orientation_edits(case.source, origin, rpy)
            message = f"every engine ignores {QUATERNION}={shown(origin.attributes[QUATERNION])}"
            yield correction(origin, message, *edits)
