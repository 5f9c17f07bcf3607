"""DX116 links-merged-wrongly: PyBullet's flag that merges links on fixed joints adds their inertias in wrong
frames.

With ``flags=p.URDF_USE_INERTIA_FROM_FILE | p.URDF_MERGE_FIXED_LINKS``, ``p.loadURDF`` makes one body of links
that fixed joints connect, which is faster to step.

- PyBullet 3.2.7 leaves out the rotation of the fixed joint and those of the inertials, and the centre of mass
  of the parent. The mass is right: the sum of both.
- Pinocchio 4.1, MuJoCo 4.0 (``fusestatic``) and Drake 1.51 merge links rightly.

On more than 40 of 65 robots of example-robot-data the mass matrix is off, by 0.2 to 54 %. A robot without
such links, for example UR5, is loaded as without the flag.

What to do: leave the flag out, or merge the links in the file.

The file is correct, and no file mends the call. ``dynx doctor`` examines this call where ``--engines`` names
it, as ``pybullet:merge``.
"""

from collections.abc import Iterable

from dynx.rules import CallingRule, Case, Detection, found_at
from dynx.rules.inertia import rigid_groups


class LinksMergedWrongly(CallingRule):
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
