"""DX308 contacts-as-forces: Links have collision shapes, whose contacts MuJoCo adds to the torque.

``<collision>`` defines the shape of a link for contacts. Two links that touch, or overlap because their
shapes are larger than the links, push each other apart in a simulation.

- MuJoCo 4.0: ``mj_inverse`` finds the contacts of the configuration and adds their forces to the torque.
  Contacts between a link and its parent are left out, those of other pairs are not. Where shapes overlap by
  design, the error of the torque is unbounded; the report calls such forces present, and names the links
  that touch at states within limits in which mimic joints follow.
- Pinocchio 4.1 (``rnea``) and PyBullet 3.2.7 (``calculateInverseDynamics``) have no contacts; PyBullet
  simulates contacts of a robot with itself only with a flag. Drake 1.51 has them where a scene graph is
  connected, and not in inverse dynamics.

What to do: know whether your torques include contacts. The file is correct, so ``dynx doctor --fix`` does not
change it; doctor compares without contacts and prints the call that switches them off in MuJoCo.
"""

from collections.abc import Iterable

from dynx.model.xml.source import SourceElement
from dynx.rules import CallingRule, Case, Detection, measured_on


class ContactsAsForces(CallingRule):
    advice = "Switch contacts off where you need rigid-body torques."
    engines = measured_on("mujoco")
    present_as = "contact_forces"
    depends_on_state = True
    calls = ("mujoco.no_contacts",)
    changed = "compared without contacts"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where two of its links have shapes."""
        shaped = [link for link in case.source.root.all("link") if _shape(link) is not None]
        first = _shape(shaped[0]) if len(shaped) > 1 else None
        if first is not None:
            message = f"{len(shaped)} links have collision shapes, which may touch"
            yield Detection(None, None, first.line, message)


def _shape(link: SourceElement) -> SourceElement | None:
    """Return the first collision of a link that is no mesh; doctor compares without meshes."""
    for collision in link.all("collision"):
        if not any(element.tag == "mesh" for element in collision.walk()):
            return collision
    return None
