"""DX118 no-inertial-data: Nothing that moves has mass or inertia, so there is no dynamics to compare.

Descriptions for display, for motion planning or from a CAD export without materials often have no
``<inertial>`` at all, or zeros in all of them. Such a file states the kinematics of a robot and nothing about
its dynamics:

- Pinocchio 4.1.0 and Drake 1.51.1 load it with a mass matrix of zero; the one then gives NaN for
  accelerations, and the other an error.
- PyBullet 3.2.7 gives 1 kg and 1 kg m^2 about every axis to each link without ``<inertial>``, and fixes a
  floating robot to the world if its root has an ``<inertial>`` of zero.
- MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL"), unless
  collision shapes other than meshes give the links a mass.

The effect: no torque, mass matrix or acceleration of this robot means anything in any engine. Poses and
Jacobians do, and they are compared.

What to do: enter the masses and inertias, from the data sheet or the CAD model.

``dynx doctor --fix`` invents no inertia, and the file is not called alike. ``--choose DX118=least`` gives
every moving body 2e-15 kg and 1.5e-14 kg m^2, with which all engines load the file; do not simulate the
result, in which a torque of 1e-6 N m turns a joint at millions of rad/s. A single moving part without mass is
DX110 or DX113.
"""

from collections.abc import Iterable, Mapping, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.inertia import has_inertial_data, rigid_groups, with_least_inertia


class NoInertialData(Rule):
    engines = measured_on("pybullet", "mujoco")
    undefined = "dynamics"
    advice = "Enter the masses and inertias; until then use the file for kinematics only."
    choices = {
        "keep": "invent no inertia, and compare the kinematics",
        "least": "give every moving body the least mass and moments that engines accept, which changes the "
        "physics",
    }
    trap_base = "floating"

    @classmethod
    def holds_for(cls, versions: Mapping[str, str]) -> bool:
        """Return True: what the file does not state is missing in every engine."""
        return True

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where nothing that moves has mass or moments."""
        if has_inertial_data(case):
            return
        missing = sum(element.first("inertial") is None for element in case.links.values())
        count = len(case.links)
        message = (
            f"of {count} links {missing} have no <inertial>, and no other that moves has mass or moments"
        )
        yield Detection(None, None, case.source.root.line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the least inertia for each moving body, if that was chosen."""
        if self.chosen(case) == "keep":
            return None
        groups = dict.fromkeys(rigid_groups(case).values())
        moving = [group.head for group in groups if not group.static]
        least = with_least_inertia(case, moving)
        return Remedy(*least, self.decision(case), changes_physics=True)
