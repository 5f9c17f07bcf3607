"""Names of robots, links and joints to which engines give a meaning."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import PurePath

from dynx.errors import shown
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import (
    Case,
    Correction,
    Detection,
    EditingRule,
    Remedy,
    Rule,
    correction,
    measured_on,
)
from dynx.rules.joints import fresh_name, joint_rename, link_rename

_WORLD = "world"


class LinkNamedWorld(Rule):
    """DX109 link-named-world: A link that is not the ground is named world, which engines mistake for the
    ground.

    URDF gives the name ``world`` no meaning, but engines do. It is harmless as the root of a robot with a
    fixed base. Elsewhere:

    - As the root with a floating base: Drake 1.51.1 mistakes the link for the world itself and fixes the
      robot to it. PyBullet 3.2.7 gives the link no mass if it has no ``<inertial>``, and then fixes it to the
      world (any other name would weigh 1 kg). MuJoCo 4.0.0 mistakes it for its world body, which cannot have
      a free joint.
    - On a link that is not the root, Drake refuses the file ("form one or more loops"). MuJoCo drops the mass
      and the tensor of that link without a warning.
    - Pinocchio 4.1.0 gives the name no meaning.

    The effect: a robot that cannot move its base, or (MuJoCo) a mass matrix without that link.

    What to do: keep the name ``world`` for the root of a robot that is fixed, and give other links other
    names. If the link stands for the ground, load the robot with a fixed base.

    ``dynx doctor --fix`` renames the link to ``world_link``, in the joints that name it and in
    ``<gazebo reference>`` too. Programs may look the link up by its old name: ``--choose DX109=keep`` keeps
    it.
    """

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


_UNIVERSE = "universe"


class JointNamedUniverse(EditingRule):
    """DX213 joint-named-universe: A fixed joint is named universe, which is Pinocchio's name for the world.

    Pinocchio 4.1 keeps a list of frames that begins with an entry ``universe``, which is the world. A fixed
    joint becomes a frame of its name, and is looked up by that name when its child link is attached, which
    finds the world. The file loads without a warning, and the robot lacks the mass beyond the joint. The mass
    matrix was off by 40 % for a tool at the end of an arm.

    A moving joint of that name does not change the model, but ``model.getJointId("universe")`` is the world
    and not that joint.

    PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended. A link named ``universe`` is harmless
    in all four.

    What to do: give the joint another name. ``dynx doctor --fix`` calls it ``universe_joint``, in mimic
    joints, transmissions and Gazebo references too. Programs that look the joint up by its name must be
    changed with it.
    """

    advice = "Give the joint another name."
    engines = measured_on("pinocchio")
    changed = "gave the joint named universe another name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the fixed joint of that name."""
        joint = case.joints.get(_UNIVERSE)
        if joint is None or joint.attributes.get("type") != "fixed":
            return
        new = fresh_name(f"{_UNIVERSE}_joint", case.joints)
        edits = tuple(joint_rename(case.source, _UNIVERSE, new))
        yield correction(joint, "the joint has the name of Pinocchio's world", *edits)


_ROOT_JOINT = "root_joint"


class JointNamedRootJoint(EditingRule):
    """DX217 joint-named-root-joint: A joint that moves is named root_joint, which is Pinocchio's name for the
    joint of a floating base.

    ``pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())`` makes a robot float. The free
    joint is called ``root_joint``, and its frame is the first in the list.

    - Pinocchio 4.1 looks the frame of a moving joint up by its name when it attaches the child link. For a
      joint named ``root_joint`` it finds the frame of the floating base: the link is fixed to the base, and
      the joint moves nothing. The file loads without a warning. The mass matrix of an arm was off by 50 to 90
      %. On the fixed base, and for a fixed joint or a link of that name, nothing happens.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended.

    What to do: give the joint another name. ``dynx doctor --fix`` calls it ``root_joint_1``, in mimic joints,
    transmissions and Gazebo references too. Programs that look the joint up by its name must be changed with
    it. Where the name must be kept, programs can give the free joint another name by the third argument:
    ``buildModelFromUrdf(path, JointModelFreeFlyer(), "free_flyer")``. The file is corrected all the same,
    because users who load it in the usual way get no warning.
    """

    advice = "Give the joint another name."
    engines = measured_on("pinocchio")
    trap_base = "floating"
    changed = "gave the joint named root_joint another name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the joint of that name, where the base floats."""
        joint = case.joints.get(_ROOT_JOINT)
        if case.base != "floating" or joint is None or joint.attributes.get("type") == "fixed":
            return
        new = fresh_name(f"{_ROOT_JOINT}_1", case.joints)
        edits = tuple(joint_rename(case.source, _ROOT_JOINT, new))
        yield correction(joint, "the joint has the name of Pinocchio's joint of a floating base", *edits)


class RobotWithoutName(EditingRule):
    """DX412 robot-without-name: The robot has no name.

    URDF requires ``<robot name="...">``. Nothing in the dynamics depends on it, but it decides whether the
    file loads.

    - Pinocchio 4.1 and PyBullet 3.2.7 refuse a robot without the attribute. Both accept an empty name.
    - Drake 1.51 refuses both.
    - MuJoCo 4.0 reads both. So does dynx, which then names the robot after its file.

    What to do: give the robot a name. ``dynx doctor --fix`` writes the name of the file, or ``robot`` for a
    text without a file.
    """

    stage = "reading"
    advice = 'Write <robot name="...">.'
    engines = measured_on("pinocchio", "pybullet", "drake")
    changed = "gave the robot a name"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the root element."""
        root = case.source.root
        if root.tag != "robot" or root.attributes.get("name"):
            return
        what = "an empty name" if "name" in root.attributes else "no name"
        source = PurePath(case.source.source)
        name = source.name.split(".")[0] if source.suffix in (".urdf", ".xacro", ".xml") else ""
        yield correction(
            root, f"<robot> has {what}", case.source.attribute_edit(root, "name", name or "robot")
        )


class PercentInName(EditingRule):
    """DX414 percent-in-name: A name has a % in it, which PyBullet uses as a printf format.

    PyBullet 3.2.7 puts names into the messages it prints, and uses some of them as the format of ``printf``.
    ``%p`` prints memory contents. ``%s`` reads memory and ``%n`` writes memory, which can end the process.
    Whether that happens depends on which message is printed (one about a link without ``<inertial>``, say),
    so a file can load for years and crash one day. dynx does not give such a file to PyBullet.

    Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 are not affected.

    What to do: use letters, digits and ``_`` in names. ``dynx doctor --fix`` writes ``_`` for ``%`` in the
    name and wherever the document mentions it (ends of joints, mimic joints, Gazebo references). Change
    programs that look up links or joints by the old name.
    """

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
            yield correction(root, _percent_message("robot", name), edit)
        for kind, named, rename in (
            ("link", case.links, link_rename),
            ("joint", case.joints, joint_rename),
        ):
            taken = set(named)
            for name, element in named.items():
                if "%" in name:
                    new = fresh_name(name.replace("%", "_"), taken)
                    taken.add(new)
                    yield correction(element, _percent_message(kind, name), *rename(source, name, new))


def _percent_message(kind: str, name: str) -> str:
    return f"the name of the {kind}, {shown(name)}, has a %"


class NameWithBlanks(EditingRule):
    """DX533 name-with-blanks: A name is blank, or begins or ends with a blank.

    ``<link name=" "/>`` or ``<joint name="elbow ">``: nobody sees the blank, and it is part of the name. A
    program that looks up ``elbow`` does not find the joint. A joint whose parent is ``base`` does not find
    the link ``base ``. Every engine refuses that file, and so does dynx, which names the similar link.

    Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 load such a file and keep the blanks, and so does
    dynx.

    What to do: write the name without them. ``dynx doctor --fix`` does so with ``--choose DX533=trim``,
    wherever the document names the link or joint. A name of blanks alone becomes ``link`` or ``joint``, with
    a number where that is taken. By default it leaves the names, which programs may use.
    """

    kind = "practice"
    stage = "reading"
    advice = "Write the name without blanks around it."
    choices = {
        "keep": "leave blanks around names as they are",
        "trim": "remove blanks around names, wherever the document mentions them",
    }
    changed = "removed blanks around names"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the robot, its links and its joints with such a name."""
        root = case.source.root
        taken = {"link": set(case.links), "joint": set(case.joints), "robot": set[str]()}
        for element in [root, *root.all("link"), *root.all("joint")]:
            name = element.attributes.get("name", "")
            if element.tag in taken and name != name.strip():
                new = fresh_name(name.strip() or element.tag, taken[element.tag])
                taken[element.tag].add(new)
                what = "is blank" if not name.strip() else "begins or ends with a blank"
                message = f"the name of the <{element.tag}>, {shown(name)}, {what}"
                yield correction(element, message, *_rename_edits(case, element, name, new))


def _rename_edits(case: Case, element: SourceElement, old: str, new: str) -> Iterable[Edit]:
    if element.tag == "link":
        return link_rename(case.source, old, new)
    if element.tag == "joint":
        return joint_rename(case.source, old, new)
    return [case.source.attribute_edit(element, "name", new)]
