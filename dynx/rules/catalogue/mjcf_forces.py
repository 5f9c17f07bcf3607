"""Forces that MJCF states and that importers of MJCF leave out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from dynx.errors import shown
from dynx.model.document_format import Format
from dynx.rules import CallingRule, Case, Detection, measured_on
from dynx.rules.mjcf import found_in, free_joints_with, mjcf_text, parts_of_bodies


class ArmatureInMassMatrix(CallingRule):
    """DX309 armature-in-mass-matrix: A joint has an armature, which some engines add to the mass matrix and
    others leave out.

    The armature is the inertia of a rotor as it acts at the joint. MJCF states it as
    ``<joint armature="0.01"/>``. In SDF it follows from ``<drake:rotor_inertia>`` and ``<drake:gear_ratio>``.

    - MuJoCo 4.0 adds the armature to the diagonal of the mass matrix, and to inverse and forward dynamics.
    - Pinocchio 4.1 (``buildModelFromMJCF``) stores the armature in ``model.armature``. ``crba``, ``rnea`` and
      ``aba`` also add it.
    - Drake 1.51 adds the armature if the joint has an actuator (``<motor joint="..."/>``). Otherwise Drake
      drops it.
    - PyBullet 3.2.7 (``loadMJCF``) drops it.

    The effect is as large as the armature. In an arm with gears it is often as large as the inertia of the
    links. A controller that was tuned with armature can be unstable without it.

    What to do: decide whether your robot model includes the rotors, and set the armature in each engine. The
    file is correct, so ``dynx doctor --fix`` does not change the file. dynx reads the armature, and its
    quantities include it with ``joint_dynamics=True``. The doctor compares the rigid bodies alone, and prints
    the calls that remove the armature from each engine.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf", "sdf")
    advice = "Decide whether rotors belong to the robot, and configure each engine accordingly."
    engines = measured_on("pinocchio", "mujoco", "drake")
    calls = ("pinocchio.no_armature", "mujoco.no_armature", "drake.no_rotors")
    changed = "compared without armature"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints that move with an armature that is not zero, free joints first."""
        if case.form == "mjcf":
            yield from free_joints_with(mjcf_text(case), "armature", "an armature of")
        for joint in case.model.joints:
            if joint.moves and joint.dynamics.armature:
                unit = "kg m^2" if joint.type != "prismatic" else "kg"
                message = f"the joint has an armature of {joint.dynamics.armature:g} {unit}"
                yield Detection(None, joint.name, joint.line, message)


class SpringInInverseDynamics(CallingRule):
    """DX310 spring-in-inverse-dynamics: A joint has a spring, which MuJoCo adds to the torque and others
    drop.

    ``<joint stiffness="5" springref="0.1"/>`` is a spring that pulls the joint to the position ``springref``.

    - MuJoCo 4.0 includes the force of the spring in ``mj_inverse`` and ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop the spring
      without a message.

    The effect is the stiffness times the distance from ``springref``. A leg that stands on its springs in
    MuJoCo falls in the other engines.

    What to do: if an engine drops the spring, add its force to your controller. The file is correct, so
    ``dynx doctor --fix`` does not change the file. dynx reads the spring, and its quantities include it with
    ``joint_dynamics=True``. The doctor compares the rigid bodies alone, and prints the call that switches
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
    """DX311 gravity-compensation: Only MuJoCo compensates the weight of a body.

    ``<body gravcomp="1"/>`` adds a force that cancels the weight of the body. (``gravcomp="0.5"`` cancels
    half of the weight.)

    - MuJoCo 4.0 applies this force in ``mj_inverse`` and in ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop it without a
      message. An arm that floats in MuJoCo hangs down in these engines.

    The effect is the share of the weight that MuJoCo cancels, in most arms all of it.

    What to do: compensate the weight by your controller, with the gravity torque of the model. The file is
    correct, so ``dynx doctor --fix`` does not change the file. dynx ignores the attribute, with a note in
    ``model.notes``. The doctor prints the call that switches the compensation off in MuJoCo.
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
    """DX312 tendon-forces: A tendon pulls at joints, but only in MuJoCo.

    ``<tendon>`` contains fixed tendons, which couple joints, and spatial tendons, which run over sites and
    geoms. The stiffness, damping, dry friction, armature and limits of a tendon cause forces at the joints.

    - MuJoCo 4.0 includes these forces in ``mj_inverse`` and ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) drop tendons. Only
      Drake prints a warning.

    The effect is the force of the tendon. If tendons close the fingers of a hand, the fingers close only in
    MuJoCo.

    What to do: if an engine drops tendons, add their forces to your controller. The file is correct, so
    ``dynx doctor --fix`` does not change the file. dynx ignores tendons, with a note in ``model.notes``. The
    doctor prints the call that switches the forces of tendons off in MuJoCo.
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
    """DX313 actuator-forces: Actuators act on the joints without a command, but only in MuJoCo.

    The actuator ``<position joint="elbow" kp="100"/>`` holds the joint at the command. In a new ``MjData``
    the command is 0. So without a command of your program, the actuator holds the joint at 0. Other actuators
    can also act without a command (``velocity``, ``intvelocity``, ``general``, ``muscle``).

    - MuJoCo 4.0 adds the force of the actuator to forward dynamics, even if your program never sets
      ``data.ctrl``. ``mj_inverse`` does not subtract it.
    - Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) drop actuators. Drake 1.51 adds
      the actuator to the plant, but no controller that commands it.

    The effect is the force of the actuator. For ``position`` it is the gain times the distance from 0. So the
    actuators hold the robot in MuJoCo, and the robot falls in the other engines.

    What to do: write the gains into your controller. The file is correct, so ``dynx doctor --fix`` does not
    change the file. The doctor compares without actuators, and prints the call that switches them off in
    MuJoCo.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write the gains of the actuators into the controller, or set the commands of the actuators."
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

    ``<equality>`` contains ``connect``, ``weld``, ``joint`` and other elements, which are soft constraints in
    MuJoCo.

    - MuJoCo 4.0 adds the forces of these constraints to ``mj_inverse`` and ``mj_forward`` if the state
      violates them. The force can be a thousand times the torque of the rigid bodies.
    - Drake 1.51 adds a constraint for ``connect`` and ``weld``. A continuous plant with this constraint
      computes no forward dynamics. Inverse dynamics ignores the constraint. Drake drops other elements, with
      a warning.
    - In Pinocchio 4.1, ``buildModelFromMJCF`` leaves loops open. ``buildModelAndConstraintsFromMJCF`` returns
      the constraints separately.
    - PyBullet 3.2.7 (``loadMJCF``) drops the constraints.

    The effect is large in robots with closed loops, such as Cassie.

    What to do: close the loops in each engine by the constraints of this engine. The file is correct, so
    ``dynx doctor --fix`` does not change the file. The doctor compares the open tree, and prints the calls
    that switch the constraints off.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Close loops and couple joints by the constraints of each engine."
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
    """DX315 fluid-forces: The file states a medium; only MuJoCo adds its drag.

    ``<option density="1.2" viscosity="1.8e-5"/>`` states the medium in which the robot moves, such as air or
    water.

    - MuJoCo 4.0 adds drag and viscous forces to every body in ``mj_inverse`` and ``mj_forward``.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) have no medium, and
      drop the attributes without a message.

    The effect grows with the speed and the size of the bodies. A swimming robot cannot swim without the
    medium.

    What to do: leave the medium out for robots on land. The file is correct, so ``dynx doctor --fix`` does
    not change the file. dynx ignores the medium, with a note in ``model.notes``. The doctor compares without
    a medium, and prints the call that switches it off in MuJoCo.
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
