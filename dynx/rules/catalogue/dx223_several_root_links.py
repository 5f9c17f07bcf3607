"""DX223 several-root-links: A link is the child of no joint, and is not the root of the robot.

A robot in URDF is one tree. A link whose joint was forgotten or commented out, or a table that was added to
the file, is a second tree beside it.

- Pinocchio 4.1 refuses the file ("two root links found"). PyBullet 3.2.7 ends the process with a crash.
- MuJoCo 4.0 fixes every such link to its world, at the origin.
- Drake 1.51 reads each tree as a body of its own: in the call that fixes the root, the others float.

dynx refuses the file: it reads one robot.

What to do: add the joint, or write two files. The file does not say where the link belongs, so ``dynx doctor
--fix`` attaches it to the root by a fixed joint without offset, as MuJoCo does. ``--choose DX223=remove``
removes the smaller trees instead. The root is that of the tree with the most links, of the first one where
that leaves a choice.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.quoting import quoteattr
from dynx.model.xml.source import Edit
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.case import end_of
from dynx.rules.joints import fresh_name


class SeveralRootLinks(EditingRule):
    stage = "reading"
    advice = "Add the joint that is missing, or write a file for each tree."
    engines = measured_on("pinocchio", "pybullet", "drake")
    choices = {
        "attach": "attach a link without joint to the root by a fixed joint, at its origin",
        "remove": "remove the trees that are not attached to the root",
    }
    changed = "attached links without joint to the root, or removed them"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the roots but that of the largest tree."""
        trees = _trees(case)
        if len(trees) < 2:
            return
        main = max(trees, key=lambda root: len(trees[root]))
        taken = set(case.joints)
        for root, links in trees.items():
            if root == main:
                continue
            edits = list(self._edits(case, root, links, main, taken))
            message = f"the link has no parent joint, and the root of the robot is {shown(main)}"
            yield correction(case.links[root], message, *edits)

    def _edits(self, case: Case, root: str, links: list[str], main: str, taken: set[str]) -> Iterable[Edit]:
        source = case.source
        if self.chosen(case) == "remove":
            yield from (source.removal(case.links[link]) for link in links)
            for joint in source.root.all("joint"):
                if end_of(joint, "child") in links:
                    yield source.removal(joint)
            return
        name = fresh_name(f"{root}_joint", taken)
        taken.add(name)
        lines = [
            f'<joint name={quoteattr(name)} type="fixed">',
            f"{source.unit}<parent link={quoteattr(main)}/>",
            f"{source.unit}<child link={quoteattr(root)}/>",
            "</joint>",
        ]
        yield source.insertion_after(case.links[root], "\n".join(lines))


def _trees(case: Case) -> dict[str, list[str]]:
    """Return the links below each root, itself included; empty where the parts form no trees."""
    joints = case.source.root.all("joint")
    ends = [(end_of(joint, "parent"), end_of(joint, "child")) for joint in joints]
    children = [child for _, child in ends]
    if len(set(children)) < len(children) or any(end not in case.links for each in ends for end in each):
        return {}
    below: dict[str, list[str]] = {}
    for parent, child in ends:
        below.setdefault(parent, []).append(child)
    trees: dict[str, list[str]] = {}
    for root in case.links:
        if root not in set(children):
            links = [root]
            for link in links:
                links += below.get(link, [])
            trees[root] = links
    return trees
