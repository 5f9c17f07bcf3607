"""DX115 inertia-from-shapes: PyBullet's plain call computes every inertia from collision shapes, not from the
file.

``p.loadURDF(path, useFixedBase=True)`` reads the mass and the origin of an ``<inertial>``, and leaves out its
tensor. The moments of inertia are those of a cuboid with the mass of the file: the bounding box of the
link's collision shapes along the axes of the inertial.

Measured with PyBullet 3.2.7:

- The cuboid is about the centre of mass of the file, wherever the shapes are. Several shapes give one box,
  round ones their bounding box, a mesh the box about its vertices in its own frame, turned with it. Margins
  of 1 to 3 mm are added on each side.
- A link without collision shapes has the inertia of a cuboid of 2 mm, almost zero; one without
  ``<inertial>`` has mass 1 and the inertia of its shapes. A text STL counts as no shape.
- A link of mass zero has no inertia.
- With the flag ``URDF_USE_INERTIA_FROM_FILE`` PyBullet reads the tensor, as Pinocchio, MuJoCo and Drake do.

On 64 of 65 robots of example-robot-data that PyBullet loads and that have joints, inverse dynamics moves by
more than 1e-6 of the largest torque, in the median by 0.8 %; on UR5 by up to 2.8 N m.

What to do: write ``p.loadURDF(path, useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE)``.

The file is correct, and no file mends the call. ``dynx doctor`` examines the plain call beside the engines,
as ``pybullet:plain``; its difference counts only where ``--engines`` names it.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at
from dynx.rules.geometry import bullet_box, collision_meshes
from dynx.rules.inertia import rigid_groups


class InertiaFromShapes(CallingRule):
    advice = "Write flags=p.URDF_USE_INERTIA_FROM_FILE in the call of loadURDF."
    engines = {"pybullet:plain": ">=3.2.7"}
    calls = ("pybullet.use_file_inertia",)
    changed = "loaded with flags=p.URDF_USE_INERTIA_FROM_FILE"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where a link that can move has mass or moments, or no inertial."""
        groups = rigid_groups(case)
        links = [
            case.links[name]
            for name, inertial in case.inertials.items()
            if not groups[name].static and (inertial is None or inertial.mass or inertial.tensor.any())
        ]
        if not links:
            return
        bare = sum(link.first("collision") is None for link in links)
        files = {mesh.attributes.get("filename", "") for link in links for _, mesh in collision_meshes(link)}
        unread = sum(bullet_box(name, case.source.source) is None for name in files)
        of_all = "the link that moves" if len(links) == 1 else f"the {len(links)} links that move"
        parts = [f"the inertia of {of_all} is computed from collision shapes"]
        parts += [f"without any: {bare}"] if bare else []
        parts += [f"meshes that are not read here and left out: {unread} of {len(files)}"] if unread else []
        yield found_at(case.source.root, "; ".join(parts))
