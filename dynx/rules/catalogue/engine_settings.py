"""Elements and flags that make one engine read another robot."""

from __future__ import annotations

from collections.abc import Iterable

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
from dynx.rules.attributes import number_or_none
from dynx.rules.geometry import bullet_box, collision_meshes
from dynx.rules.inertia import rigid_groups


class InertiaScaledForContact(EditingRule):
    """DX114 inertia-scaled-for-contact: A link has inertia_scaling; only PyBullet multiplies the inertia by
    it.

    ``<contact><inertia_scaling value="3.0"/></contact>`` is an extension of PyBullet, which makes contacts of
    light links more stable. Many files that come with PyBullet, and files copied from them, have it.

    - PyBullet 3.2.7 multiplies the moments of inertia of the link by the value, but not the mass. It does so
      even with ``URDF_USE_INERTIA_FROM_FILE``, and even in ``calculateInverseDynamics`` and
      ``calculateMassMatrix``.
    - Pinocchio 4.1, MuJoCo 4.0, Drake 1.51 and dynx ignore the element.

    The effect is that of a wrong tensor. With a value of 3, the mass matrix is off by a few per cent, and by
    more for light links.

    What to do: remove the element if the dynamics matters. ``dynx doctor --fix`` removes it, and leaves the
    rest of ``<contact>`` in place.
    """

    advice = "Remove <inertia_scaling>."
    engines = measured_on("pybullet")
    changed = "removed <inertia_scaling>"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the scales other than 1."""
        for scaling in case.elements("link", "contact", "inertia_scaling"):
            # PyBullet reads 0 where the value is no number.
            scale = number_or_none(scaling, "value") or 0.0
            if scale != 1.0:
                message = f"PyBullet multiplies the moments of inertia of the link by {scale:g}"
                yield correction(scaling, message, case.source.removal(scaling))


class InertiaFromShapes(CallingRule):
    """DX115 inertia-from-shapes: PyBullet's plain call computes every inertia from collision shapes, not from
    the file.

    ``p.loadURDF(path, useFixedBase=True)`` reads the mass and the origin of an ``<inertial>``, and ignores
    its tensor. The moments of inertia are those of a cuboid with the mass in the file. The cuboid is the
    bounding box of the link's collision shapes, along the axes of the inertial.

    Measured with PyBullet 3.2.7:

    - The centre of the cuboid is the centre of mass in the file, wherever the shapes are. All shapes of a
      link together give one cuboid. A mesh counts as the bounding box of its vertices, in the axes of the
      mesh. PyBullet adds margins of 1 to 3 mm on each side.
    - A link without collision shapes has the inertia of a cuboid of 2 mm, almost zero. A link without
      ``<inertial>`` has a mass of 1 kg and the inertia of its shapes. PyBullet reads no shape from an STL
      file in text form.
    - A link of mass zero has no inertia.
    - With the flag ``URDF_USE_INERTIA_FROM_FILE`` PyBullet reads the tensor, as Pinocchio, MuJoCo and Drake
      do.

    PyBullet loads 65 robots of example-robot-data that have joints. With the plain call, inverse dynamics of
    64 of these robots is off by more than 1e-6 of the largest torque. The median of the error is 0.8 %. On
    UR5 the error is up to 2.8 N m.

    What to do: write ``p.loadURDF(path, useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE)``.

    The file is correct, and no change of the file corrects the call. ``dynx doctor`` also examines the plain
    call, as the variant ``pybullet:plain``. It counts a difference of the variant only if ``--engine`` names
    the variant.
    """

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
        parts += [f"{bare} of them {'has' if bare == 1 else 'have'} no such shape"] if bare else []
        parts += [f"meshes that are not read here and left out: {unread} of {len(files)}"] if unread else []
        yield found_at(case.source.root, "; ".join(parts))


class LinksMergedWrongly(CallingRule):
    """DX116 links-merged-wrongly: PyBullet's flag URDF_MERGE_FIXED_LINKS adds inertias in wrong frames.

    With ``flags=p.URDF_USE_INERTIA_FROM_FILE | p.URDF_MERGE_FIXED_LINKS``, ``p.loadURDF`` merges rigidly
    connected links into one body. The simulation is then faster.

    - When PyBullet 3.2.7 merges two links, it ignores the rotation of the fixed joint, the rotations of both
      inertial frames, and the centre of mass of the parent. The mass of the merged body is right.
    - Pinocchio 4.1, MuJoCo 4.0 (``fusestatic``) and Drake 1.51 merge links correctly.

    On more than 40 of 65 robots of example-robot-data the mass matrix is off by 0.2 to 54 %. For other
    robots, such as UR5, the flag changes no result.

    What to do: leave the flag out, or merge the links in the file.

    The file is correct, and no change of the file corrects the call. ``dynx doctor`` examines this call only
    if ``--engine`` names the variant ``pybullet:merge``.
    """

    advice = "Leave p.URDF_MERGE_FIXED_LINKS out of the call of loadURDF."
    engines = {"pybullet:merge": ">=3.2.7"}
    calls = ("pybullet.keep_fixed_links",)
    changed = "loaded without flags=p.URDF_MERGE_FIXED_LINKS"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where links on fixed joints can move."""
        groups = rigid_groups(case)
        merged = sum(name in group.parents and not group.static for name, group in groups.items())
        if merged:
            links = "1 link" if merged == 1 else f"{merged} links"
            yield found_at(case.source.root, f"{links} on fixed joints can move with their parents")


_MUJOCO_SETTINGS = {
    "compiler": (
        *("boundmass", "boundinertia", "settotalmass", "balanceinertia", "inertiafromgeom"),
        *("inertiagrouprange", "autolimits"),
    ),
    "option": ("density", "viscosity", "wind"),
    "flag": (
        *("constraint", "equality", "frictionloss", "limit", "contact", "gravity"),
        *("passive", "spring", "damper"),
    ),
}
"""Attributes that change masses or forces, by element."""


class MujocoSettings(EditingRule):
    """DX224 mujoco-settings: The file has settings of MuJoCo's compiler that change the masses or forces of
    the robot.

    MuJoCo reads an element ``<mujoco>`` in a URDF, usually for the folder of the meshes. But some attributes
    of its ``<compiler>`` change the robot. ``boundmass`` and ``boundinertia`` raise small masses and moments.
    ``settotalmass`` scales all masses. ``balanceinertia`` and ``inertiafromgeom`` replace tensors. With
    ``autolimits="false"`` MuJoCo refuses the limits of a URDF. In ``<option>`` the attributes ``density``,
    ``viscosity`` and ``wind`` add the drag of a fluid. ``<flag>`` can switch gravity or constraints off.

    - MuJoCo 4.0 applies these settings.
    - Pinocchio 4.1, PyBullet 3.2.7, Drake 1.51 and dynx ignore ``<mujoco>``.

    The effect in MuJoCo can have any size. For example, ``settotalmass`` scales all torques.

    What to do: write the intended masses and tensors into the file, and set options in the program.
    ``dynx doctor --fix`` removes these attributes and leaves the others, such as ``meshdir`` and
    ``fusestatic``. ``--choose DX224=keep`` keeps them; MuJoCo then reads another robot.
    """

    stage = "reading"
    advice = "Remove these settings from <mujoco>."
    engines = measured_on("mujoco")
    choices = {
        "remove": "remove settings of MuJoCo that change masses or forces",
        "keep": "keep these settings; MuJoCo then reads another robot",
    }
    changed = "removed settings of MuJoCo that change masses or forces"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the elements with such an attribute."""
        for mujoco in case.source.root.all("mujoco"):
            for element in mujoco.walk():
                names = [name for name in _MUJOCO_SETTINGS.get(element.tag, ()) if name in element.attributes]
                if names:
                    edits = [case.source.attribute_removal(element, name) for name in names]
                    message = f"<{element.tag}> of <mujoco> sets {' and '.join(names)}"
                    yield correction(element, message, *edits)
