"""DX221 world-not-declared: A joint has the parent ``world``, which is not a link of the file.

In Drake a link named ``world`` is the world itself and need not be declared, so a file written for Drake
fixes its first link by ``<parent link="world"/>`` alone. In URDF every parent is a link of the file.

- Drake 1.51 reads the file, and attaches the joint to its world.
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 refuse it: no link has that name. So does dynx.

What to do: declare ``<link name="world"/>``. ``dynx doctor --fix`` does so, at the beginning of the robot.
All engines then read the robot that Drake reads: a root of this name on a fixed base is harmless in all of
them. Load such a robot with the fixed base; on a floating one the world would float, see DX109.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.case import end_of

_WORLD = "world"


class WorldNotDeclared(EditingRule):
    stage = "reading"
    advice = 'Declare <link name="world"/>.'
    engines = measured_on("pinocchio", "pybullet", "mujoco")
    changed = "declared the link world"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first joint on the world, where the world is not declared."""
        if _WORLD in case.links:
            return
        for joint in case.source.root.all("joint"):
            if end_of(joint, "parent") == _WORLD:
                root = case.source.root
                edit = case.source.insertion(root, f'<link name="{_WORLD}"/>', first=True)
                message = "the parent of the joint is world, which the file does not declare as a link"
                yield correction(joint, message, edit)
                return
