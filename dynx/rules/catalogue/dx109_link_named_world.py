"""DX109 link-named-world: A link that is not the ground is named world, which engines mistake for the ground.

URDF gives the name ``world`` no meaning, but engines do. It is harmless as the root of a robot with a fixed
base. Elsewhere:

- As the root with a floating base: Drake 1.51.1 mistakes the link for the world itself and fixes the robot to
  it. PyBullet 3.2.7 gives the link no mass if it has no ``<inertial>``, and then fixes it to the world (any
  other name would weigh 1 kg). MuJoCo 4.0.0 mistakes it for its world body, which cannot have a free joint.
- On a link that is not the root: Drake refuses the file ("form one or more loops"), and MuJoCo drops the mass
  and the tensor of that link without a warning.
- Pinocchio 4.1.0 gives the name no meaning.

The effect: a robot that cannot move its base, or (MuJoCo) a mass matrix without that link.

What to do: keep the name ``world`` for the root of a robot that is fixed, and give other links other names.
If the link stands for the ground, load the robot with a fixed base.

``dynx doctor --fix`` renames the link to ``world_link``, in the joints that name it and in ``<gazebo
reference>`` too. Programs may look the link up by its old name: ``--choose DX109=keep`` keeps it.
"""

from collections.abc import Iterable, Sequence

from dynx.rules import Case, Detection, Remedy, Rule, measured_on
from dynx.rules.joints import fresh_name, link_rename

_WORLD = "world"


class LinkNamedWorld(Rule):
    engines = measured_on("drake", "mujoco")
    advice = "Give the link another name, or load the robot with a fixed base."
    choices = {
        "rename": "give the link another name, wherever the document names it",
        "keep": "keep the name; engines that give it a meaning then read another robot",
    }
    trap_base = "floating"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield a link of that name, unless it is the root on the fixed base."""
        element = case.links.get(_WORLD)
        root = case.model.root
        if element is None or (root == _WORLD and case.base == "fixed"):
            return []
        what = "the root, although the base floats," if root == _WORLD else f"a link below the root {root}"
        return [Detection(_WORLD, None, element.line, f"{what} is named world")]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the remedy that renames the link to a name that no link has."""
        if self.chosen(case) == "keep":
            return None
        name = fresh_name(f"{_WORLD}_link", case.links)
        source = case.source.apply(*link_rename(case.source, _WORLD, name))
        done = f"renamed the link {_WORLD} to {name}"
        return Remedy(case.with_source(source), done, self.decision(case))
