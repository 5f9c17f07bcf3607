"""DX307 rotor-inertia: An actuator has a rotor inertia, which only Drake adds to its joint.

``<drake:rotor_inertia value="0.001"/>`` and ``<drake:gear_ratio value="10"/>`` in the ``<actuator>`` of a
``<transmission>`` are an extension of Drake. A rotor behind a gear of ratio n adds n^2 times its own inertia
to the joint.

- Drake 1.51 adds that to the diagonal of the mass matrix and to inverse dynamics.
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 do not know the tags. Neither does dynx.

The effect is the reflected inertia: for a geared arm often as large as that of the links.

What to do: decide whether the rotors belong to your robot. Pinocchio has ``model.armature`` for them, MuJoCo
``dof_armature``, dynx ``<dynamics armature="...">``. The file is correct, so ``dynx doctor --fix`` does not
change it; doctor compares without rotors and prints the call that switches them off in Drake.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, measured_on
from dynx.rules.attributes import number_or_none
from dynx.rules.joints import moves_by_actuator

_TAG = "drake:rotor_inertia"


class RotorInertia(CallingRule):
    advice = "Decide whether rotors belong to the robot, and configure each engine accordingly."
    engines = measured_on("drake")
    calls = ("drake.no_rotors",)
    changed = "compared without rotors"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield actuators with a rotor inertia that is not zero."""
        for transmission in case.source.root.all("transmission"):
            joint = transmission.first("joint") if moves_by_actuator(case, transmission) else None
            for actuator in transmission.all("actuator"):
                for rotor in actuator.all(_TAG):
                    inertia = number_or_none(rotor, "value")
                    if inertia and joint is not None:
                        message = f"the actuator of the joint has a rotor of {inertia:g} kg m^2"
                        yield Detection(None, joint.attributes.get("name"), rotor.line, message)
