"""Forces at joints and between links that some engines add to the rigid-body torque."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from dynx.errors import DynxError, shown
from dynx.model.document_format import Format
from dynx.model.xml.source import SourceElement
from dynx.rules import (
    CallingRule,
    Case,
    Correction,
    Detection,
    EditingRule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import completion, misspelled_numbers, number_or_none, positive_edit
from dynx.rules.joints import SINGLE, elements_in_joints, moves_by_actuator
from dynx.rules.mjcf import free_joints_with, mjcf_text

_IN_MJCF = {"damping": ("damping", "damper"), "friction": ("frictionloss", "frictionloss")}
"""Attribute of MJCF and flag of its options for each coefficient."""


def _stated_coefficients(case: Case, name: str, what: str) -> Iterable[Detection]:
    """Yield the joints of MJCF or SDF that move with a coefficient that is not zero, free joints first."""
    if case.form == "mjcf":
        document = mjcf_text(case)
        attribute, flag = _IN_MJCF[name]
        if document.options.disabled(flag) is None:
            yield from free_joints_with(document, attribute, what)
    for joint in case.model.joints:
        value = getattr(joint.dynamics, name)
        if joint.moves and value:
            yield Detection(None, joint.name, joint.line, f"the joint has {what} {value:g}")


class DampingInInverseDynamics(CallingRule):
    """DX301 damping-in-inverse-dynamics: A joint has damping, which some engines add to the torque and others
    do not.

    ``<dynamics damping="0.5"/>`` is a torque against the velocity of a joint. In some engines inverse
    dynamics includes this torque:

    - Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``) do not include damping.
    - MuJoCo 4.0 (``mj_inverse``) and Drake 1.51 (``CalcInverseDynamics`` with the plant's force elements)
      include damping. This also holds for MJCF and SDF. PyBullet (``loadMJCF``) drops the damping in MJCF.
      For a ``<joint type="free" damping="1"/>``, only MuJoCo includes the damping of the floating base.
    - Forward dynamics includes damping in PyBullet's ``stepSimulation``, in MuJoCo and in Drake, but not in
      Pinocchio's ``aba``.

    The effect is damping times velocity, often a few per cent of the torque. If the inertia is small, it is
    most of the torque.

    What to do: decide whether torques include damping. Then add ``damping * v`` to Pinocchio's torque, or
    switch damping off in the other engines. The file is correct, so ``dynx doctor --fix`` does not change the
    file. dynx returns the torque of the rigid bodies alone, unless you write ``joint_dynamics=True``. The
    doctor compares this torque, and prints the calls that switch damping off in each engine. A floating base
    has no damping in dynx, with a note in ``model.notes``: write ``<freejoint/>``, which has none either.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf", "sdf")
    advice = "Decide whether torques include damping, and configure each engine accordingly."
    engines = measured_on("pybullet", "mujoco", "drake")
    calls = ("pybullet.no_damping", "mujoco.no_damping", "drake.no_damping")
    changed = "compared without joint damping"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with a damping that is not zero."""
        if case.form != "urdf":
            yield from _stated_coefficients(case, "damping", "damping")
            return
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if damping := number_or_none(dynamics, "damping"):
                yield found_at(dynamics, f"the joint has damping {damping:g}")


class FrictionInInverseDynamics(CallingRule):
    """DX302 friction-in-inverse-dynamics: A joint has dry friction, which MuJoCo adds to the torque and
    others do not.

    ``<dynamics friction="0.2"/>`` is a constant torque against the motion of a joint.

    - MuJoCo 4.0 reads the friction as ``frictionloss``, a constraint. ``mj_inverse`` adds the force of this
      constraint: the friction times the sign of the velocity. At low speed the force is smaller, because a
      smaller force can hold the joint.
    - Pinocchio 4.1 stores the friction, but does not use it. PyBullet 3.2.7 does not use it in inverse
      dynamics. Drake 1.51 prints a warning that it does not support friction.

    The effect is as large as the friction: a few per cent of the torque for an arm with gears.

    What to do: decide whether torques include friction. The file is correct, so ``dynx doctor --fix`` does
    not change the file. dynx returns the torque of the rigid bodies alone, unless you write
    ``joint_dynamics=True``. The doctor compares this torque, and prints the call that switches friction off
    in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    advice = "Decide whether torques include friction, and configure MuJoCo accordingly."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_friction",)
    changed = "compared without dry friction"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with a friction that is not zero."""
        if case.form != "urdf":
            yield from _stated_coefficients(case, "friction", "dry friction")
            return
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if friction := number_or_none(dynamics, "friction"):
                yield found_at(dynamics, f"the joint has dry friction {friction:g}")


class NegativeDamping(EditingRule):
    """DX303 negative-damping: The damping of a joint is negative.

    - Drake 1.51 refuses the file: "joint damping must be nonnegative".
    - MuJoCo 4.0 and PyBullet 3.2.7 simulate a joint that accelerates itself.
    - Pinocchio 4.1 stores the number and does not use it.

    The torque of the rigid bodies does not depend on damping. With ``joint_dynamics=True`` dynx uses the
    negative number, with a note.

    What to do: correct the sign. ``dynx doctor --fix`` removes it. ``--choose DX303=zero`` writes 0 instead.
    """

    stage = "reading"
    advice = "Write a damping of at least 0."
    engines = measured_on("drake")
    choices = {
        "absolute": "remove the sign of a negative damping",
        "zero": "make a negative damping zero",
    }
    changed = "made the damping of joints positive or zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints that move."""
        for _, dynamics in elements_in_joints(case, "dynamics", SINGLE):
            if (number_or_none(dynamics, "damping") or 0.0) < 0.0:
                edit, written = positive_edit(case, dynamics, "damping", zero=self.chosen(case) == "zero")
                yield correction(dynamics, f"the joint has damping {written}", edit)


class MimicAsConstraint(CallingRule):
    """DX304 mimic-as-constraint: A joint mimics another joint: some engines add a constraint, and others
    ignore it.

    ``<mimic joint="a" multiplier="2" offset="0.1"/>`` means that the joint is always at 2 a + 0.1.

    - Pinocchio 4.1 and PyBullet 3.2.7 ignore ``<mimic>``, and the joint moves freely. In Pinocchio,
      ``buildModelFromUrdf(..., mimic=True)`` makes a joint without a coordinate.
    - MuJoCo 4.0 adds a soft equality constraint, and the joint has a coordinate. If the state violates the
      constraint, ``mj_inverse`` adds the force of the constraint, which can be a hundred times the torque.
    - Drake 1.51 adds a constraint. Discrete-time simulation satisfies the constraint, inverse dynamics
      ignores it, and continuous-time forward dynamics raises an error.

    No engine is wrong, but the engines load different robots. In dynx a mimic joint has no coordinate, and
    its torque acts on the joint that it follows, on every backend.

    What to do: find out how your engine reads mimic joints. The doctor compares all engines with free mimic
    joints, and prints the calls that switch the constraints off. The file is correct, so
    ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "sdf")
    advice = "Find out whether mimic joints are free, constrained or dependent in your engine."
    engines = measured_on("mujoco", "drake")
    calls = ("mujoco.no_mimic", "drake.free_mimics")
    changed = "compared with mimic joints free"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that follow a moving joint."""
        if case.form == "sdf":
            for joint in case.model.joints:
                if joint.mimic is not None:
                    message = f"the joint mimics {shown(joint.mimic.joint)}"
                    yield Detection(None, joint.name, joint.line, message)
            return
        for joint in case.model.joints:
            mimic = case.joints[joint.name].first("mimic")
            if joint.mimic is not None and mimic is not None:
                yield found_at(mimic, f"the joint mimics {shown(mimic.attributes['joint'])}")


_EITHER = ("damping", "friction")


class EmptyDynamics(EditingRule):
    """DX305 empty-dynamics: A dynamics element has neither damping nor friction.

    Examples are ``<dynamics/>``, or an element that has only an extension such as ``armature="0.01"``. In
    URDF both ``damping`` and ``friction`` are optional.

    - Pinocchio 4.1 and PyBullet 3.2.7 refuse the file ("joint dynamics element specified with no damping and
      no friction"), for every type of joint, even fixed joints.
    - MuJoCo 4.0 and Drake 1.51 read the file.

    What to do: write ``damping="0"``, or remove the element. ``dynx doctor --fix`` corrects a misspelled
    name, such as ``<dynamics dampng="0.5"/>``. Otherwise it adds ``damping="0"``, and keeps the other
    attributes.
    """

    stage = "reading"
    advice = 'Write damping="0", or remove the element.'
    engines = measured_on("pinocchio", "pybullet")
    changed = "wrote a damping of 0 into <dynamics> without damping and friction"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first ``<dynamics>`` of every joint, moving or not."""
        for _, dynamics in elements_in_joints(case, "dynamics"):
            if not set(_EITHER) & dynamics.attributes.keys():
                meant = misspelled_numbers(dynamics, _EITHER)
                message = "<dynamics> has neither damping nor friction"
                yield completion(case, dynamics, message, tuple(meant) or _EITHER[:1], "0")


class LimitsAsForces(CallingRule):
    """DX306 limits-as-forces: A joint has two equal limits, and PyBullet pulls the joint to them.

    ``<limit lower="-2" upper="2"/>`` defines the range of a joint. URDF and SDF do not define what happens
    beyond this range. A joint with two equal limits is beyond its range at every other position.

    - Pinocchio 4.1 and Drake 1.51 ignore limits in inverse and forward dynamics. Only Drake's discrete
      simulation has limits.
    - In MuJoCo 4.0 a constraint force pushes back a joint that is beyond its limit. ``mj_inverse`` adds this
      force to the torque. The force can be a hundred times the torque. MuJoCo ignores equal limits, with a
      warning.
    - In PyBullet 3.2.7 ``stepSimulation`` pushes back a joint that is beyond its limit, even if the limits
      are equal. ``calculateInverseDynamics`` ignores limits. PyBullet ignores a limit of ``lower="0"``
      without ``upper`` (see DX216 for other limits without ``upper``).

    The doctor compares engines at positions within the limits, where all engines agree. A joint with equal
    limits has no such range. The doctor compares it at any position, because the equations of motion have no
    limits.

    What to do: write the range of the joint, or ``type="fixed"`` (see DX508). The file does not say which of
    the two is right, so ``dynx doctor --fix`` does not change the file. The doctor prints the calls that
    switch limits off.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "sdf")
    advice = "Write the range of the joint, or switch its limits off."
    engines = measured_on("pybullet")
    calls = ("pybullet.no_limits", "mujoco.no_limits")
    changed = "compared without joint limits"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with equal limits."""
        for joint in case.model.joints:
            if not joint.moves or joint.limits.lower != joint.limits.upper:
                continue
            message = f"the lower and the upper limit of the joint are {joint.limits.lower + 0.0:g}"
            if case.form == "sdf":
                yield Detection(None, joint.name, joint.line, message)
                continue
            limit = case.joints[joint.name].first("limit")
            if limit is not None and "upper" in limit.attributes:
                yield found_at(limit, message)


_ROTOR_TAG = "drake:rotor_inertia"


class RotorInertia(CallingRule):
    """DX307 rotor-inertia: An actuator has a rotor inertia, which only Drake adds to its joint.

    In the ``<actuator>`` of a ``<transmission>``, Drake reads two elements of its own:
    ``<drake:rotor_inertia value="0.001"/>`` and ``<drake:gear_ratio value="10"/>``. A rotor behind a gear of
    ratio n adds n^2 times its own inertia to the joint. This is the reflected inertia, or armature.

    - Drake 1.51 adds the armature to the diagonal of the mass matrix and to inverse dynamics.
    - Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and dynx ignore these elements in URDF.

    The effect is as large as the armature. In an arm with gears it is often as large as the inertia of the
    links.

    What to do: decide whether your robot model includes the rotors. For the armature, Pinocchio has
    ``model.armature``, MuJoCo has ``dof_armature``, and dynx reads ``<dynamics armature="...">``. The file is
    correct, so ``dynx doctor --fix`` does not change the file. The doctor compares without rotors, and prints
    the call that switches them off in Drake.
    """

    advice = "Decide whether rotors belong to the robot, and configure each engine accordingly."
    engines = measured_on("drake")
    calls = ("drake.no_rotors",)
    changed = "compared without rotors"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield actuators with a rotor inertia that is not zero."""
        for transmission in case.source.root.all("transmission"):
            joint = transmission.first("joint") if moves_by_actuator(case, transmission) else None
            for actuator in transmission.all("actuator"):
                for rotor in actuator.all(_ROTOR_TAG):
                    inertia = number_or_none(rotor, "value")
                    if inertia and joint is not None:
                        message = f"the actuator of the joint has a rotor of {inertia:g} kg m^2"
                        yield Detection(None, joint.attributes.get("name"), rotor.line, message)


class ContactsAsForces(CallingRule):
    """DX308 contacts-as-forces: Links have collision shapes, whose contacts MuJoCo adds to the torque.

    ``<collision>`` defines the shape of a link for contacts. In a simulation, two links push each other apart
    if their shapes touch or overlap. Shapes often overlap because they are larger than the links.

    - MuJoCo 4.0: ``mj_inverse`` finds the contacts of the configuration, and adds their forces to the torque.
      It leaves out only contacts between a link and its parent. If shapes overlap, the error of the torque
      can have any size.
    - Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``) have no contacts. PyBullet
      simulates contacts of a robot with itself only with a flag. Drake 1.51 has contacts if a scene graph is
      connected, but not in inverse dynamics.

    The doctor searches for states at which links touch. In these states all joints are within their limits,
    and mimic joints follow their leading joints. The report names the links that touch.

    What to do: find out whether your torques include contacts. The file is correct, so ``dynx doctor --fix``
    does not change the file. The doctor compares without contacts, and prints the call that switches them off
    in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    advice = "Switch contacts off if you need torques of the rigid bodies alone."
    engines = measured_on("mujoco")
    present_as = "contact_forces"
    depends_on_state = True
    calls = ("mujoco.no_contacts",)
    changed = "compared without contacts"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where two of its links have shapes."""
        if case.form == "mjcf":
            touching = [link for link in case.model.links if _collides(case, link.name)]
            if touching:
                have = "1 body has" if len(touching) == 1 else f"{len(touching)} bodies have"
                message = f"{have} geoms, which may touch each other and the world"
                yield Detection(None, None, touching[0].line, message)
            return
        shaped = [link for link in case.source.root.all("link") if _first_shape(link) is not None]
        first = _first_shape(shaped[0]) if len(shaped) > 1 else None
        if first is not None:
            message = f"{len(shaped)} links have collision shapes, which may touch"
            yield Detection(None, None, first.line, message)


def _collides(case: Case, link: str) -> bool:
    """Check whether a link of MJCF has geoms that may touch others, also such as dynx does not read."""
    try:
        return bool(case.model.geometry.collisions(link))
    except DynxError:
        return True


def _first_shape(link: SourceElement) -> SourceElement | None:
    """Return the first collision of a link that is no mesh; doctor compares without meshes."""
    for collision in link.all("collision"):
        if not any(element.tag == "mesh" for element in collision.walk()):
            return collision
    return None
