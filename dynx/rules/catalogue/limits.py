"""Limits of joints: missing, exchanged, negative, or without effect."""

from __future__ import annotations

from collections.abc import Iterable

from dynx.errors import escaped
from dynx.model.xml.source import Edit, SourceElement
from dynx.model.xml.text import quoteattr
from dynx.rules import (
    Case,
    Correction,
    Detection,
    EditingRule,
    Rule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import completion, meant_name, number_or_none
from dynx.rules.joints import SINGLE, UNLIMITED, elements_in_joints, joints_of_type
from dynx.rules.numbers_in_text import LARGEST, corrected_version

_ZERO_LIMIT = f'<limit lower="0" upper="0" effort="{LARGEST}" velocity="{LARGEST}"/>'


class JointWithoutLimit(EditingRule):
    """DX203 joint-without-limit: A revolute or prismatic joint has no limit.

    URDF requires a ``<limit>``. The type of a joint that can rotate without limit is ``continuous``.

    - Pinocchio 4.1 and PyBullet 3.2.7 refuse the file.
    - MuJoCo 4.0 and Drake 1.51 read a joint without limits.

    A misspelled element, such as ``<Limit>``, has the same effect, because readers ignore it.

    What to do: write the limits of the joint. ``dynx doctor --fix`` corrects a misspelled element. If there
    is no such element, ``dynx doctor --fix`` leaves the joint unlimited: a revolute joint becomes
    ``continuous``, and a prismatic joint gets the largest double for its limits. ``--choose DX203=zero``
    writes ``lower="0" upper="0"`` instead. These numbers are URDF's defaults in a ``<limit>``. Simulations
    with limits then hold the joint at 0.
    """

    stage = "reading"
    advice = 'Write the <limit> of the joint, or type="continuous".'
    engines = measured_on("pinocchio", "pybullet")
    choices = {
        "unlimited": "leave the joint unlimited; a revolute joint becomes continuous",
        "zero": "write 0 for the missing lower and upper limits",
    }
    changed = "made joints without limit continuous, or gave them one"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such joints."""
        for joint in joints_of_type(case, ("revolute", "prismatic")):
            if joint.first("limit") is None:
                message = f"the joint is {joint.attributes['type']} and has no <limit>"
                written = [each for each in joint.children if meant_name(each.tag, ("limit",), ())]
                if len(written) == 1:
                    place = found_at(joint, f"{message}; its limits are in <{escaped(written[0].tag)}>")
                    yield Correction(place, (_limit_renamed(case, written[0]),), ("<limit>",), whole=True)
                else:
                    yield correction(joint, message, self._correction_edit(case, joint))

    def _correction_edit(self, case: Case, joint: SourceElement) -> Edit:
        if self.chosen(case) == "zero":
            return case.source.insertion(joint, _ZERO_LIMIT)
        if joint.attributes["type"] == "revolute":
            return case.source.attribute_edit(joint, "type", "continuous")
        return case.source.insertion(joint, UNLIMITED)


def _limit_renamed(case: Case, element: SourceElement) -> Edit:
    """Return the edit that makes an element a limit with the same attributes."""
    attributes = (f"{name}={quoteattr(text)}" for name, text in element.attributes.items())
    return case.source.replacement(element, f"<{' '.join(('limit', *attributes))}/>")


class LimitWithoutEffortOrVelocity(EditingRule):
    """DX204 limit-without-effort-or-velocity: A limit does not state the largest effort or velocity.

    Up to version 1.1, URDF requires the attributes ``effort`` and ``velocity``. They do not affect the
    equations of motion.

    - Pinocchio 4.1 refuses the file ("limit has no effort"), for every type of joint, even fixed joints. If
      the robot states ``version="1.2"``, Pinocchio reads the file (see DX222).
    - PyBullet 3.2.7, MuJoCo 4.0, Drake 1.51 and dynx read the file. In dynx a missing limit means unlimited.

    Files with such limits are common, because only urdfdom, the reader of Pinocchio and ROS, checks them.

    What to do: write both attributes. ``dynx doctor --fix`` corrects a misspelled name, such as
    ``velocty="2"``. For a missing attribute it writes the largest double. Every engine reads this number, and
    dynx reads it as "no limit".
    """

    stage = "reading"
    advice = "Write effort and velocity into every <limit>."
    engines = measured_on("pinocchio")
    changed = "wrote the largest double for efforts and velocities that were not given"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first limit of every joint, moving or not, in a robot of URDF 1.0 or 1.1."""
        if corrected_version(case) == "1.2":
            return
        for _, limit in elements_in_joints(case, "limit"):
            missing = [name for name in ("effort", "velocity") if name not in limit.attributes]
            if missing:
                message = f"<limit> has no {' and no '.join(missing)}"
                yield completion(case, limit, message, missing, LARGEST)


class LowerLimitAboveUpper(EditingRule):
    """DX205 lower-limit-above-upper: The lower limit of a joint is above its upper limit.

    Usually the two limits were exchanged, or the sign of one was lost.

    - Drake 1.51 refuses the file. Its message shows a failed condition in Drake's C++ sources. Drake also
      refuses such limits of a continuous joint, although they have no meaning there.
    - MuJoCo 4.0 and PyBullet 3.2.7 treat the joint as unlimited.
    - Pinocchio 4.1 stores the limits unchanged, so random configurations and clamping are wrong.

    The equations of motion do not depend on limits. dynx uses the smaller number as the lower limit.

    What to do: correct the limits. ``dynx doctor --fix`` exchanges them. ``--choose DX205=unlimited`` makes
    the joint unlimited in all engines, as it is in MuJoCo and PyBullet.
    """

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


class NegativeEffortOrVelocity(EditingRule):
    """DX206 negative-effort-or-velocity: The largest effort or speed of a joint is negative.

    Some authors write ``-1`` for "no limit", as in other formats. Any other negative number is a mistake.

    - Pinocchio 4.1 refuses the file: "Some components of min_effort are greater than max_effort".
    - Drake 1.51 refuses a negative velocity. Its message shows a failed condition in its C++ sources. Drake
      refuses a negative effort only if a ``<transmission>`` gives the joint an actuator ("which has a
      negative effort limit"). Otherwise it ignores the effort.
    - PyBullet 3.2.7 reads both limits unchanged. MuJoCo 4.0 does not read the velocity, and drops the sign of
      the effort.

    The equations of motion do not depend on these limits. dynx reads the number, with a note.

    What to do: write the intended limits. ``dynx doctor --fix`` removes the sign. If ``-1`` means "no limit",
    ``--choose DX206=unlimited`` writes the largest double instead.
    """

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


class SafetyControllerWithoutGain(EditingRule):
    """DX207 safety-controller-without-gain: A safety controller has no k_velocity.

    ``<safety_controller>`` is an element for controllers in ROS. No engine simulates it. URDF requires its
    attribute ``k_velocity``; its other attributes are optional.

    - Pinocchio 4.1 refuses the file: "joint safety: no k_velocity".
    - PyBullet 3.2.7 and MuJoCo 4.0 ignore it. Drake 1.51 warns that it ignores it.

    What to do: if one of your programs reads the element, complete it; otherwise remove it.
    ``dynx doctor --fix`` corrects a misspelled name, such as ``k_velocty="20"``. Otherwise it adds
    ``k_velocity="0"``. The safety controller then has no effect.
    """

    stage = "reading"
    advice = "Write k_velocity, or remove the <safety_controller>."
    engines = measured_on("pinocchio")
    changed = "gave safety controllers without k_velocity one of 0"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first safety controller of every joint."""
        for _, controller in elements_in_joints(case, "safety_controller"):
            if "k_velocity" not in controller.attributes:
                message = "<safety_controller> has no k_velocity"
                yield completion(case, controller, message, ("k_velocity",), "0")


_UPPER_OF_PYBULLET = -1.0
"""Upper limit that PyBullet uses where none is given; URDF has 0."""


class UpperLimitMissing(EditingRule):
    """DX216 upper-limit-missing: A limit has a lower of -1 or less and no upper; PyBullet reads the missing
    upper as -1.

    In URDF a missing ``lower`` or ``upper`` is 0, so ``<limit lower="-2" .../>`` is the range -2 to 0. This
    is rarely intended.

    - PyBullet 3.2.7 reads a missing ``upper`` as -1, so the range is -2 to -1. A joint between -1 and 0 is
      outside this range. In ``stepSimulation`` such a joint can move towards -1, but not away from -1.
      ``calculateInverseDynamics`` ignores limits.
    - Pinocchio 4.1 and dynx (with a note) read the range -2 to 0.
    - Drake 1.51 reads a lower limit of -2 and no upper limit. MuJoCo 4.0 ignores a ``<limit>`` that has only
      ``lower`` or only ``upper``.

    Only PyBullet's reading hinders a motion that the file allows. If ``lower`` is above -1, it is above
    PyBullet's ``upper``. Then PyBullet ignores both limits. A missing ``lower`` is 0 in PyBullet and
    Pinocchio, and "no limit" in Drake and MuJoCo.

    The effect: in PyBullet's simulation, a joint between -1 and 0 does not accelerate.

    What to do: write the intended limit. ``dynx doctor --fix`` corrects a misspelled name, such as
    ``uper="1"``. Otherwise it writes ``upper="0"``, as URDF, Pinocchio and dynx read it. The other three
    engines then read the same range.
    """

    advice = "Write lower and upper of every range."
    engines = measured_on("pybullet")
    changed = 'wrote upper="0" where a limit has no upper end'
    depends_on_state = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield limits of joints that have a range: a continuous one has none in any engine's motion."""
        for _, limit in elements_in_joints(case, "limit", ("revolute", "prismatic")):
            lower = number_or_none(limit, "lower")
            if "upper" in limit.attributes or lower is None or lower > _UPPER_OF_PYBULLET:
                continue
            message = f"lower is {lower:g} and upper is not given, which is 0 in URDF and -1 in PyBullet"
            yield completion(case, limit, message, ("upper",), "0")


_TYPES_WITH_LIMIT = ("revolute", "prismatic", "fixed", "floating", "planar")


class LimitIncompleteInUrdf12(EditingRule):
    """DX222 limit-incomplete-in-urdf-1-2: A robot states URDF 1.2, and a limit lacks lower or upper.

    Up to URDF 1.1, a missing ``lower`` or ``upper`` is 0. From URDF 1.2, the ``<limit>`` of every joint that
    is not continuous needs ``lower`` and ``upper``, but ``effort`` and ``velocity`` may be missing.

    - Pinocchio 4.1 (its reader is urdfdom) refuses the file: "revolute and prismatic joints must have both
      lower and upper position limits specified in URDF version 1.2 or later". It also refuses a fixed joint
      with such a ``<limit>``.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore the version. dynx reads a missing limit as 0.

    What to do: write both limits. ``dynx doctor --fix`` corrects a misspelled name, such as ``uper="1"``.
    Otherwise it writes 0 for the missing limit, as earlier versions of URDF define it.
    """

    stage = "reading"
    advice = "Write the lower and the upper limit."
    engines = measured_on("pinocchio")
    changed = "wrote 0 for ends of limits that URDF 1.2 requires"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield limits without one of the ends, in a robot of URDF 1.2."""
        if corrected_version(case) != "1.2":
            return
        for _, limit in elements_in_joints(case, "limit", _TYPES_WITH_LIMIT):
            missing = [end for end in ("lower", "upper") if end not in limit.attributes]
            if missing:
                message = f"the <limit> has no {' and no '.join(missing)}"
                yield completion(case, limit, message, missing, "0")


class EffortLimitZero(Rule):
    """DX506 effort-limit-zero: The effort limit of a joint is zero, so its motor can apply no force.

    Authors mostly write ``effort="0"`` because URDF requires the attribute. But the number means that the
    motor can apply no force.

    Pinocchio and PyBullet store the zero. A program that saturates torques at this limit gets zero torque.
    Gazebo and ros_control apply no force to such a joint. MuJoCo reads 0 as "no limit" (no ``actfrcrange``).
    Drake reads 0 as "no actuator" if a transmission names the joint. The equations of motion are the same in
    all engines.

    For a passive joint, such as a wheel without motor, zero is correct. The rule does not report mimic
    joints, which need no motor. The file does not contain the true limit, so no edit removes the cause.
    """

    kind = "practice"
    advice = "Write the largest torque [N m] or force [N] of the motor at the joint."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints with a coordinate of their own and an effort limit of exactly zero."""
        for joint in case.model.coordinate_joints:
            if joint.limits.effort == 0.0:
                effort = "force" if joint.type == "prismatic" else "torque"
                message = f"the effort limit is 0, so no {effort} is allowed"
                yield Detection(None, joint.name, joint.line, message)


class VelocityLimitZero(Rule):
    """DX507 velocity-limit-zero: The velocity limit of a joint is zero, so it must not move.

    Authors mostly write ``velocity="0"`` because URDF requires the attribute. But the number means that the
    joint must not move.

    Planners that time a path (MoveIt, TOPP-RA, Ruckig) divide by the limit, or report that there is no
    trajectory. Pinocchio and Drake store the zero. PyBullet stores it as ``maxVelocity`` and does not apply
    it. MuJoCo does not read it. The equations of motion are the same in all engines.

    The file does not contain the true limit, so no edit removes the cause.
    """

    kind = "practice"
    advice = 'Write the largest speed [rad/s or m/s] of the joint, or type="fixed" if it never moves.'

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield moving joints with a coordinate of their own and a velocity limit of exactly zero."""
        message = "the velocity limit is 0, so the joint must not move"
        for joint in case.model.coordinate_joints:
            if joint.limits.velocity == 0.0:
                yield Detection(None, joint.name, joint.line, message)


class RangeOfZeroWidth(Rule):
    """DX508 range-of-zero-width: The lower and upper limit of a joint are equal or absent, so it has no range
    to move in.

    In URDF the default of ``lower`` and ``upper`` is 0. So a ``<limit>`` without them has the range 0 to 0:
    the joint has a coordinate, but cannot move.

    The equations of motion are the same in all engines. But engines read the limits differently:

    - Both attributes are absent: Pinocchio reads the range 0 to 0. In PyBullet, MuJoCo and Drake the joint
      has no limits and moves freely.
    - Both attributes have the same number: Pinocchio and Drake keep the limits. PyBullet's ``stepSimulation``
      holds the joint at this number. MuJoCo prints a warning and ignores the limits.

    The file does not say whether the author meant ``fixed``, ``continuous`` or a range, so no edit removes
    the cause.
    """

    kind = "practice"
    advice = 'Write the range of the joint, or type="continuous" if the joint has no range, or type="fixed".'

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield revolute and prismatic joints with a coordinate of their own and no range."""
        for joint in case.model.coordinate_joints:
            if joint.type == "continuous" or joint.limits.lower != joint.limits.upper:
                continue
            limit = case.joints[joint.name].first("limit")
            absent = limit is not None and not {"lower", "upper"} & set(limit.attributes)
            why = "no lower and upper limit, which URDF reads as 0" if absent else "equal limits"
            message = f"the joint has {why}: its whole range is {joint.limits.lower:.6g}"
            yield Detection(None, joint.name, joint.line, message)


_ENDS = ("lower", "upper")


class LimitsOnContinuousJoint(EditingRule):
    """DX509 limits-on-continuous-joint: A continuous joint has a lower or an upper limit, which has no
    meaning there.

    A joint with ``type="continuous"`` rotates without limit, so ``lower`` and ``upper`` have no meaning.
    Pinocchio and MuJoCo ignore them. PyBullet reports them in ``getJointInfo`` and does not apply them. In
    Drake 1.51 they are the limits of the joint. The equations of motion are the same in all engines. But a
    reader of the file may think that the joint has this range.

    What to do: if the joint has a range, write ``type="revolute"``. Otherwise remove the two attributes, so
    that the joint is unlimited in every engine. By default ``dynx doctor --fix`` leaves them. With
    ``--choose DX509=drop`` it removes them.
    """

    kind = "practice"
    advice = 'Remove the range, or write type="revolute" if the joint has a range.'
    choices = {
        "keep": "keep the limits of continuous joints, which have no meaning",
        "drop": "remove the lower and upper limits of continuous joints",
    }
    changed = "removed the lower and upper limits of continuous joints"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield continuous joints with `lower` or `upper`."""
        for _, limit in elements_in_joints(case, "limit", ("continuous",)):
            written = [end for end in _ENDS if end in limit.attributes]
            if written:
                listed = " and ".join(f'{end}="{limit.attributes[end]}"' for end in written)
                edits = tuple(case.source.attribute_removal(limit, end) for end in written)
                yield correction(limit, f"{listed} on a joint that rotates without limit", *edits)


class ZeroOutsideLimits(Rule):
    """DX510 zero-outside-limits: Zero lies outside the range of a joint, and nearly every tool starts there.

    Nearly every tool starts at zero: PyBullet after loadURDF, RViz, MuJoCo's ``qpos0``,
    ``pinocchio.neutral``, and Drake's default context. If zero is outside the range of a joint, a simulation
    begins with a force that pushes the joint back. Planners refuse such a start state. The robot cannot reach
    the zero configuration, so a check for self-collisions in this configuration has no use.

    Such a range is valid, and right for an elbow that cannot be stretched. So the doctor reports it and does
    not correct it. Another zero of the joint would change the numbers in every program that uses the robot.
    """

    kind = "practice"
    advice = "Give your programs a start configuration inside the limits."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with a coordinate of their own whose range does not contain zero."""
        for joint in case.model.coordinate_joints:
            lower, upper = sorted((joint.limits.lower, joint.limits.upper))
            if not lower <= 0.0 <= upper:
                message = f"the range {lower:.6g} to {upper:.6g} does not contain 0"
                yield Detection(None, joint.name, joint.line, message)
