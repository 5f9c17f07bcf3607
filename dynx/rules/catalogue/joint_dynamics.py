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


def _stated_coefficients(case: Case, name: str, what: str) -> Iterable[Detection]:
    """Yield the joints of MJCF or SDF that move with a coefficient that is not zero."""
    for joint in case.model.joints:
        value = getattr(joint.dynamics, name)
        if joint.moves and value:
            yield Detection(None, joint.name, joint.line, f"the joint has {what} {value:g}")


class DampingInInverseDynamics(CallingRule):
    """DX301 damping-in-inverse-dynamics: A joint has damping, which some engines add to the torque and others
    do not.

    ``<dynamics damping="0.5"/>`` resists the velocity of a joint. There are two conventions on whether
    inverse dynamics includes it:

    - Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``): rigid bodies only.
    - MuJoCo 4.0 (``mj_inverse``): damping times velocity is added.
    - Drake 1.51 (``CalcInverseDynamics`` with the plant's force elements): likewise.
    - MJCF and SDF: MuJoCo and Drake likewise. PyBullet (``loadMJCF``) drops damping.
    - Forward dynamics: PyBullet's ``stepSimulation``, MuJoCo and Drake damp, Pinocchio's ``aba`` does not.

    The effect is damping times velocity, often a few per cent of the torque. Where the inertia is low, it is
    most of the torque.

    What to do: decide which convention you want, and add ``damping * v`` to Pinocchio's torque or switch
    damping off in the others. The file is correct, so ``dynx doctor --fix`` does not change it. dynx returns
    the rigid-body torque unless called with ``joint_dynamics=True``. The doctor compares the rigid-body
    torque and prints the calls that switch damping off in each engine.
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

    ``<dynamics friction="0.2"/>`` is a force that opposes the motion at any speed.

    - MuJoCo 4.0 reads it as ``frictionloss``, a constraint. ``mj_inverse`` adds the force of the constraint:
      the friction times the sign of the velocity, or less at low speed, where the constraint can hold the
      joint.
    - Pinocchio 4.1 stores it and does not use it. PyBullet 3.2.7 does not use it in inverse dynamics. Drake
      1.51 warns that it does not support it.

    The effect is the friction itself, a few per cent of the torque for a geared arm.

    What to do: decide which convention you want. The file is correct, so ``dynx doctor --fix`` does not
    change it. dynx returns the rigid-body torque unless called with ``joint_dynamics=True``. The doctor
    compares the rigid-body torque and prints the call that switches friction off in MuJoCo.
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

    Nothing in the rigid-body dynamics depends on it. With ``joint_dynamics=True`` dynx uses the number
    unchanged, with a note.

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
    """DX304 mimic-as-constraint: A joint mimics another: a constraint to some engines, nothing to others.

    ``<mimic joint="a" multiplier="2" offset="0.1"/>`` means that the joint is always at 2 a + 0.1.

    - Pinocchio 4.1 and PyBullet 3.2.7 load the joint as free and ignore the tag. Pinocchio has
      ``buildModelFromUrdf(..., mimic=True)``, with which the joint has no coordinate.
    - MuJoCo 4.0 makes a soft equality constraint of it, and the joint has a coordinate. Where the constraint
      is violated, ``mj_inverse`` adds the restoring force, which can be a hundred times the torque.
    - Drake 1.51 makes a constraint of it that discrete-time simulation keeps. Its inverse dynamics ignores
      it, and continuous-time forward dynamics refuses to run.

    None of these is wrong. They are different robots. dynx gives a mimic joint no coordinate, and its torque
    goes to the joint it follows, in every backend.

    What to do: know which interpretation you use. doctor compares all engines with every joint free, where
    the dynamics of the bodies is the same, and prints the calls that switch the constraints off. The file is
    correct, so ``dynx doctor --fix`` does not change it.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "sdf")
    advice = "Know whether mimic joints are free, constrained or dependent in your engine."
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

    ``<dynamics/>``, or one that holds only an extension such as ``armature="0.01"``. URDF makes both
    attributes optional and defines their defaults. It does not require one of them.

    - Pinocchio 4.1 and PyBullet 3.2.7 refuse the file: "joint dynamics element specified with no damping and
      no friction". They do so for every type of joint, fixed ones included.
    - MuJoCo 4.0 and Drake 1.51 read it.

    What to do: write ``damping="0"``, or remove the element. ``dynx doctor --fix`` adds ``damping="0"``,
    which keeps other attributes. A number under a misspelled name, ``<dynamics dampng="0.5"/>``, is what was
    meant, and gets the right name.
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
    """DX306 limits-as-forces: A joint has equal limits, to which some engines pull the joint.

    ``<limit lower="-2" upper="2"/>`` defines the range of a joint. URDF does not define what happens beyond,
    and a joint with equal limits violates them at every other position.

    - Pinocchio 4.1 and Drake 1.51: no effect. Inverse and forward dynamics have no limits (Drake's discrete
      simulation does).
    - MuJoCo 4.0: a joint beyond its limit is pushed back by a constraint force, and ``mj_inverse`` adds that
      force to the torque. Forces of a hundred times the torque were measured. MuJoCo ignores equal limits,
      with a warning.
    - PyBullet 3.2.7: ``stepSimulation`` pushes the joint back to the limit, equal ones included.
      ``calculateInverseDynamics`` ignores limits. PyBullet ignores a limit of ``lower="0"`` without ``upper``
      (see DX216 for other limits without ``upper``).

    Within limits all engines agree, and doctor compares there. A joint with equal limits is compared at any
    position, because the equations of motion have no limits.

    What to do: write the range of the joint, or ``type="fixed"`` (see DX508). The file does not say which, so
    ``dynx doctor --fix`` does not change it. The doctor prints the calls that switch limits off.
    """

    advice = "Write the range of the joint, or switch its limits off."
    engines = measured_on("pybullet")
    calls = ("pybullet.no_limits", "mujoco.no_limits")
    changed = "compared without joint limits"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with equal limits."""
        for joint in case.model.joints:
            limit = case.joints[joint.name].first("limit")
            if limit is None or "upper" not in limit.attributes:
                continue
            if joint.moves and joint.limits.lower == joint.limits.upper:
                message = f"the lower and the upper limit of the joint are {joint.limits.lower:g}"
                yield found_at(limit, message)


_ROTOR_TAG = "drake:rotor_inertia"


class RotorInertia(CallingRule):
    """DX307 rotor-inertia: An actuator has a rotor inertia, which only Drake adds to its joint.

    ``<drake:rotor_inertia value="0.001"/>`` and ``<drake:gear_ratio value="10"/>`` in the ``<actuator>`` of a
    ``<transmission>`` are an extension of Drake. A rotor behind a gear of ratio n adds n^2 times its own
    inertia to the joint.

    - Drake 1.51 adds that to the diagonal of the mass matrix and to inverse dynamics.
    - Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 do not know the tags. Neither does dynx.

    The effect is the reflected inertia: for a geared arm often as large as that of the links.

    What to do: decide whether the rotors belong to your robot. Pinocchio has ``model.armature`` for them,
    MuJoCo ``dof_armature``, dynx ``<dynamics armature="...">``. The file is correct, so ``dynx doctor --fix``
    does not change it. The doctor compares without rotors and prints the call that switches them off in
    Drake.
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

    ``<collision>`` defines the shape of a link for contacts. Two links that touch, or overlap because their
    shapes are larger than the links, push each other apart in a simulation.

    - MuJoCo 4.0: ``mj_inverse`` finds the contacts of the configuration and adds their forces to the torque.
      Contacts between a link and its parent are left out, those of other pairs are not. If shapes overlap by
      design, the error of the torque is unbounded. The report calls such forces present. It names the links
      that touch at states within limits in which mimic joints follow.
    - Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``) have no contacts. PyBullet
      simulates contacts of a robot with itself only with a flag. Drake 1.51 has them where a scene graph is
      connected, and not in inverse dynamics.

    What to do: know whether your torques include contacts. The file is correct, so ``dynx doctor --fix`` does
    not change it. The doctor compares without contacts and prints the call that switches them off in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf")
    advice = "Switch contacts off where you need rigid-body torques."
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
                message = f"{len(touching)} bodies have geoms, which may touch each other and the world"
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
