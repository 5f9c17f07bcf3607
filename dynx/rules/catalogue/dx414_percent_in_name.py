"""DX414 percent-in-name: A name has a % in it, which PyBullet uses as a printf format.

PyBullet 3.2.7 puts names into the messages it prints, and uses some of them as the format of ``printf``:
``%p`` prints memory contents, ``%s`` and ``%n`` read or write it and can end the process. Whether that
happens depends on which message is printed (one about a link without ``<inertial>``, say), so a file can load
for years and crash one day. dynx does not give such a file to PyBullet.

Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 are not affected.

What to do: use letters, digits and ``_`` in names. ``dynx doctor --fix`` writes ``_`` for ``%`` in the name
and wherever the document mentions it (ends of joints, mimic joints, Gazebo references); programs that look
links or joints up by the old name must be changed with it.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import fresh_name, joint_rename, link_rename


class PercentInName(EditingRule):
    stage = "reading"
    advice = "Use letters, digits and _ in names."
    engines = measured_on("pybullet")
    changed = "wrote _ for % in names"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield robot, links and joints of such a name."""
        source = case.source
        root = source.root
        if "%" in root.attributes.get("name", ""):
            name = root.attributes["name"]
            edit = source.attribute_edit(root, "name", name.replace("%", "_"))
            yield correction(root, _message("robot", name), edit)
        for kind, named, rename in (
            ("link", case.links, link_rename),
            ("joint", case.joints, joint_rename),
        ):
            taken = set(named)
            for name, element in named.items():
                if "%" in name:
                    new = fresh_name(name.replace("%", "_"), taken)
                    taken.add(new)
                    yield correction(element, _message(kind, name), *rename(source, name, new))


def _message(kind: str, name: str) -> str:
    return f"the name of the {kind}, {shown(name)}, has a %"
