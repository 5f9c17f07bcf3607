"""Forces that MJCF states and that importers of MJCF leave out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from dynx.errors import shown
from dynx.model.document_format import Format
from dynx.rules import CallingRule, Case, Detection, measured_on
from dynx.rules.mjcf import found_in, mjcf_text, parts_of_bodies


class ArmatureInMassMatrix(CallingRule):
    """DX309 armature-in-mass-matrix: A joint has an armature, which some engines add to the mass matrix and
    others leave out.

    ``<joint armature="0.01"/>`` of MJCF is the inertia of a rotor, as it acts at the joint. SDF has it as
    ``<drake:rotor_inertia>``, behind a gear of ``<drake:gear_ratio>``.

    - MuJoCo 4.0 adds it to the diagonal of the mass matrix, and to inverse and forward dynamics.
    - Pinocchio 4.1 (``buildModelFromMJCF``) keeps it in ``model.armature``, which ``crba``, ``rnea`` and
      ``aba`` add, too.
    - Drake 1.51 adds it where the joint has an actuator (``<motor joint="..."/>``), and else drops it.
    - PyBullet 3.2.7 (``loadMJCF``) drops it.

    The effect is the armature itself. For a geared arm it is often as large as the inertia of the links, and
    controllers tuned with it are unstable without.

    What to do: decide whether the rotors belong to your robot, and set them in each engine. The file is
    correct, so ``dynx doctor --fix`` does not change it. dynx reads the armature, and its quantities have it
    with ``joint_dynamics=True``. doctor compares the rigid bodies alone, and prints the calls that remove the
    armature from each engine.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf", "sdf")
    advice = "Decide whether rotors belong to the robot, and configure each engine accordingly."
    engines = measured_on("pinocchio", "mujoco", "drake")
    calls = ("pinocchio.no_armature", "mujoco.no_armature", "drake.no_rotors")
    changed = "compared without armature"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with an armature that is not zero."""
        for joint in case.model.joints:
            if joint.moves and joint.dynamics.armature:
                unit = "kg m^2" if joint.type != "prismatic" else "kg"
                message = f"the joint has an armature of {joint.dynamics.armature:g} {unit}"
                yield Detection(None, joint.name, joint.line, message)


class SpringInInverseDynamics(CallingRule):
    """DX310 spring-in-inverse-dynamics: A joint has a spring, which MuJoCo adds to the torque and others
    drop.

    ``<joint stiffness="5" springref="0.1"/>`` pulls the joint to its reference.

    - MuJoCo 4.0 has the force of the spring in ``mj_inverse`` and ``mj_forward``, and the armature of a
      spring that is integrated implicitly.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop it without a
      message.

    The effect is the stiffness times the distance from the reference. A leg that stands on its springs in
    MuJoCo falls in the others.

    What to do: add the force of the spring to your controller where the engine has none. The file is
    correct, so ``dynx doctor --fix`` does not change it. dynx reads the spring, and its quantities have it
    with ``joint_dynamics=True``. doctor compares the rigid bodies alone, and prints the call that switches
    springs off in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Add the force of the spring in the engines that drop it, or leave it out everywhere."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_springs",)
    changed = "compared without springs of joints"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints with a stiffness that is not zero."""
        document = mjcf_text(case)
        for part in parts_of_bodies(document, "joint"):
            stiffness = part.resolved.attributes.get("stiffness", "0").split()
            if any(float(each) for each in stiffness):
                message = f"the joint has the stiffness {stiffness[0]}"
                yield found_in(document, part.given, message, joint=part.given.attributes.get("name"))


class GravityCompensation(CallingRule):
    """DX311 gravity-compensation: The weight of a body is compensated, by MuJoCo alone.

    ``<body gravcomp="1"/>`` is a force against the weight of the body.

    - MuJoCo 4.0 applies it as a passive force, in ``mj_inverse`` and in ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop it without a
      message: there the arm hangs down that floats in MuJoCo.

    The effect is the share of the weight that is compensated, for most arms all of it.

    What to do: compensate the weight by your controller, by the gravity torque of the model. The file is
    correct, so ``dynx doctor --fix`` does not change it. dynx does not read it and says so in the notes of
    the model. The doctor prints the call that switches the compensation off in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Compensate the weight by the controller, in every engine."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_gravity_compensation",)
    changed = "compared without gravity compensation"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield bodies whose weight is compensated."""
        document = mjcf_text(case)
        for part in parts_of_bodies(document, "body"):
            share = part.given.attributes.get("gravcomp", "0")
            if float(share):
                message = f"{share} of the weight of the body is compensated"
                yield found_in(document, part.given, message, link=part.given.attributes.get("name"))


class TendonForces(CallingRule):
    """DX312 tendon-forces: A tendon pulls at joints, in MuJoCo alone.

    ``<tendon>`` holds fixed tendons, which couple joints, and spatial ones, which run over sites and geoms.
    Their stiffness, damping, dry friction, armature and limits are forces at the joints.

    - MuJoCo 4.0 has these forces in ``mj_inverse`` and ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop tendons, Drake
      with a warning.

    The effect is the force of the tendon. Hands whose fingers close by tendons do not close elsewhere.

    What to do: write the forces of the tendons into your controller where an engine has none. The file is
    correct, so ``dynx doctor --fix`` does not change it. dynx does not read tendons, and says so in the notes
    of the model. The doctor prints the call that switches their forces off in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Add the forces of tendons in the engines that drop them, or leave them out everywhere."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_tendons",)
    changed = "compared without forces of tendons"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield tendons."""
        document = mjcf_text(case)
        for element in document.sections("tendon"):
            name = element.attributes.get("name")
            who = f"the tendon {shown(name)}" if name else "the tendon"
            yield found_in(document, element, f"{who} acts on the joints")


class ActuatorForces(CallingRule):
    """DX313 actuator-forces: Actuators act on the joints without a command, in MuJoCo alone.

    ``<position joint="elbow" kp="100"/>`` holds the joint at the command, which is 0 in a new ``MjData``.
    Other actuators with a bias (``velocity``, ``intvelocity``, ``general``, ``muscle``) do likewise.

    - MuJoCo 4.0 adds the force to forward dynamics, also where ``data.ctrl`` was never set. ``mj_inverse``
      does not subtract it.
    - Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) drop actuators. Drake 1.51
      makes an actuator without a controller.

    The effect is the force of the actuator: gain times the distance from 0.

    What to do: know that a robot with such actuators is held in MuJoCo and falls elsewhere. Port the gains
    into your controller. The file is correct, so ``dynx doctor --fix`` does not change it. doctor compares
    without actuators, and prints the call that switches them off.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Port the gains of actuators into the controller, or set their commands."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_actuators",)
    changed = "compared without actuators"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield actuators that act without a command, or may."""
        document = mjcf_text(case)
        for element in document.sections("actuator"):
            if element.tag != "motor":
                joint = element.attributes.get("joint")
                yield found_in(document, element, f"<{element.tag}> acts without a command", joint=joint)


class EqualityAsConstraint(CallingRule):
    """DX314 equality-as-constraint: An equality constraint closes a loop or couples joints in some engines.

    ``<equality>`` holds ``connect``, ``weld``, ``joint`` and others, which MuJoCo makes soft constraints.

    - MuJoCo 4.0 adds their forces to ``mj_inverse`` and ``mj_forward``, wherever they are violated: a
      thousand times the torque of the rigid bodies was measured.
    - Drake 1.51 makes a constraint of ``connect`` and ``weld`` with which a continuous plant computes no
      forward dynamics. Its inverse dynamics ignores the constraint, as for an open tree. It drops others with
      a warning.
    - Pinocchio 4.1: ``buildModelFromMJCF`` leaves loops open. ``buildModelAndConstraintsFromMJCF`` returns
      the constraints apart. PyBullet 3.2.7 (``loadMJCF``) drops them.

    Without its constraints a robot with closed loops, such as a Cassie, is another robot.

    What to do: close the loops in each engine by its own means. The file is correct, so ``dynx doctor
    --fix`` does not change it. doctor compares the open tree, and prints the calls that switch the
    constraints off.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Close loops and couple joints in each engine by its own means."
    engines = measured_on("mujoco", "drake")
    calls = ("mujoco.no_mimic", "drake.free_mimics")
    changed = "compared without equality constraints"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the constraints that are active."""
        document = mjcf_text(case)
        for element in document.sections("equality"):
            if element.attributes.get("active", "true") != "false":
                yield found_in(document, element, f"<{element.tag}> is a constraint")


class FluidForces(CallingRule):
    """DX315 fluid-forces: The file states a medium, whose drag MuJoCo alone adds.

    ``<option density="1.2" viscosity="1.8e-5"/>`` is the medium in which the robot moves.

    - MuJoCo 4.0 adds drag and viscous forces to every body in ``mj_inverse`` and ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) have no medium, and
      drop the attributes without a message.

    The effect grows with speed and with the size of the bodies: a swimmer does not move at all without it.

    What to do: leave the medium out for robots on land. The file is correct, so ``dynx doctor --fix`` does
    not change it. dynx has no medium, and says so in the notes of the model. The doctor compares without a
    medium, and prints the call that switches it off in MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Leave the medium out, or model its forces in every engine."
    engines = measured_on("mujoco")
    calls = ("mujoco.no_fluid",)
    changed = "compared without a medium"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the options that state a medium."""
        document = mjcf_text(case)
        for option in document.root.all("option"):
            given = [
                name
                for name in ("density", "viscosity")
                if float(option.attributes.get(name, "0").split()[0])
            ]
            if given:
                yield found_in(document, option, f"<option> states the {' and the '.join(given)} of a medium")
