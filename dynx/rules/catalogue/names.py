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

    URDF gives the name ``world`` no meaning, but engines do. The name is harmless for the root link of a
    robot with a fixed base. In other cases:

    - The root link with a floating base: Drake 1.51.1 mistakes the link for the world, and fixes the robot to
      it. MuJoCo 4.0.0 mistakes the link for its world body, which cannot have a free joint. If the link has
      no ``<inertial>``, PyBullet 3.2.7 gives it no mass (a link of another name gets 1 kg), and so fixes it
      to the world.
    - A link that is not the root: Drake refuses the file ("form one or more loops"). MuJoCo drops the mass
      and the tensor of the link without a warning.
    - Pinocchio 4.1.0 gives the name no meaning.

    The effect: the base of the robot cannot move. In MuJoCo the mass matrix may lack this link.

    What to do: use the name ``world`` only for the root link of a robot with a fixed base. If the link stands
    for the ground, load the robot with a fixed base.

    ``dynx doctor --fix`` renames the link to ``world_link``. It also changes the name in joints and in
    ``<gazebo reference>``. If a program looks the link up by its old name, ``--choose DX109=keep`` keeps the
    name.
    """

    engines = measured_on("drake", "mujoco")
    advice = "Give the link another name, or load the robot with a fixed base."
    choices = {
        "rename": "give the link another name, wherever the file uses the name",
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

    The list of frames of Pinocchio 4.1 begins with a frame ``universe``, which is the world. Pinocchio makes
    a frame of each fixed joint, with the name of the joint. To attach the child link, it looks up this name.
    For ``universe`` it finds the world. The file loads without a warning, but the robot lacks the mass beyond
    the joint. For a tool at the end of an arm, the mass matrix was off by 40 %.

    A moving joint of this name does not change the model. But ``model.getJointId("universe")`` returns the
    world instead of this joint.

    PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended. A link named ``universe`` is harmless
    in all four engines.

    What to do: give the joint another name. ``dynx doctor --fix`` renames it to ``universe_joint``. It also
    changes the name in mimic joints, transmissions and Gazebo references. If a program looks up the joint by
    its name, also change the program.
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

    ``pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer())`` loads a robot with a floating
    base. Pinocchio names the joint of the floating base ``root_joint``.

    - Pinocchio 4.1 attaches the child link of a moving joint to the frame with the joint's name. For a joint
      named ``root_joint`` it finds the frame of the floating base. So it fixes the link to the base, and the
      joint moves nothing. The file loads without a warning. The mass matrix of an arm was off by 50 to 90 %.
      With a fixed base there is no error. A fixed joint or a link of this name also causes no error.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the file as intended.

    What to do: give the joint another name. ``dynx doctor --fix`` renames it to ``root_joint_1``. It also
    changes the name in mimic joints, transmissions and Gazebo references. If a program looks up the joint by
    its name, also change the program. If you must keep the name, give the joint of the floating base another
    name in the call: ``buildModelFromUrdf(path, JointModelFreeFlyer(), "free_flyer")``.
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

    URDF requires ``<robot name="...">``.

    - Pinocchio 4.1 and PyBullet 3.2.7 refuse a robot without the attribute ``name``. They accept an empty
      name.
    - Drake 1.51 refuses a missing name and an empty name.
    - MuJoCo 4.0 and dynx accept both. dynx then names the robot after its file.

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
    """DX414 percent-in-name: A name contains %, which PyBullet uses as a printf format.

    PyBullet 3.2.7 prints messages with names, and uses some of these messages as the format of ``printf``. In
    such a message ``%p`` prints memory contents, ``%s`` reads memory and ``%n`` writes memory. This can end
    the process. This happens only if PyBullet prints such a message, for example about a link without
    ``<inertial>``. So a file can load for years and then crash. dynx does not give such a file to PyBullet.

    Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 are not affected.

    What to do: use letters, digits and ``_`` in names. ``dynx doctor --fix`` replaces ``%`` by ``_`` in the
    name, and wherever the file uses the name (parents and children of joints, mimic joints, Gazebo
    references). If a program looks up a link or joint by the old name, also change the program.
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

    Examples are ``<link name=" "/>`` and ``<joint name="elbow ">``. The blank is part of the name, but nobody
    sees it. A program that looks up ``elbow`` does not find the joint.

    Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0, Drake 1.51 and dynx load such a file and keep the blanks. They
    refuse the file if a joint has the parent ``base`` and the link is named ``base ``. dynx then names the
    similar link.

    What to do: write the name without these blanks. By default ``dynx doctor --fix`` leaves the names,
    because programs may use them. With ``--choose DX533=trim`` it removes the blanks wherever the file uses
    the name. A name of blanks alone becomes ``link`` or ``joint``, with a number if this name exists already.
    """

    kind = "practice"
    stage = "reading"
    advice = "Write the name without blanks around it."
    choices = {
        "keep": "leave blanks around names as they are",
        "trim": "remove blanks around names, wherever the file uses the names",
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
