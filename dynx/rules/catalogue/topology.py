"""Types of joints, and how joints connect links."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from dynx.engines.pybullet.file_checks import MAX_JOINTS
from dynx.errors import shown
from dynx.model import Model
from dynx.model.elements import Link
from dynx.model.xml.source import Edit
from dynx.model.xml.text import quoteattr
from dynx.rules import Case, Correction, Detection, EditingRule, Remedy, Rule, correction, measured_on
from dynx.rules.case import end_of
from dynx.rules.joints import TYPES, fresh_name, joint_split, joints_of_type, specifies_base


class JointOfSeveralFreedoms(EditingRule):
    """DX210 joint-of-several-freedoms: A joint is spherical, planar or floating.

    URDF has the types ``planar`` and ``floating``. The types ``spherical`` and ``ball`` are extensions.
    Engines read these types in many different ways:

    - ``spherical``: Pinocchio 4.1 and Drake 1.51 refuse the file. PyBullet 3.2.7 reads it, but mass matrix
      and inverse dynamics fail, or have other coordinates than the state of the joint. MuJoCo 4.0 reads the
      joint with a quaternion, but refuses the usual limits of such a joint.
    - ``ball``: no engine reads this type.
    - ``planar``: Pinocchio uses the coordinates (x, y, cos, sin). MuJoCo and Drake use three joints or
      coordinates. PyBullet moves the joint, but has no dynamics for it.
    - ``floating`` in the middle of a tree: Pinocchio uses a quaternion. PyBullet makes the joint fixed, and
      prints one line on stdout. MuJoCo and Drake refuse the file, or leave the link free in the world.

    dynx reads ``spherical`` as a ball joint, the motion of which is that of PyBullet's joint. As in PyBullet,
    ``<axis>`` has no effect and damping acts about each of the three axes. The limits ``lower``, ``upper``
    and ``twist`` of such a joint are angles of swing and twist in PyBullet. dynx writes a note and does not
    apply them. dynx refuses the other types in URDF. The doctor compares the engines on the file with the
    remedy.

    What to do: write joints of one degree of freedom each, with massless links between them.
    ``dynx doctor --fix`` replaces the joint by such a chain. A spherical joint becomes three rotations, a
    planar joint becomes two translations and a rotation, and a floating joint becomes three translations and
    three rotations. The chain has the same motion. Three rotations are singular if the middle angle is 90
    degrees. The chain has no limits. MuJoCo refuses massless links that move (DX110), so the links in between
    have 2e-15 kg. ``--choose DX210=fixed`` makes the joint fixed instead.
    """

    stage = "reading"
    advice = "Write joints of one degree of freedom each, with massless links between them."
    engines = measured_on("pinocchio", "pybullet", "drake")
    choices = {
        "split": "split a joint of several degrees of freedom into joints of one, without its limits",
        "fixed": "make a joint of several degrees of freedom fixed",
    }
    changed = "replaced joints of several degrees of freedom"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such joints, except a floating one below an empty root (DX211)."""
        for joint in joints_of_type(case, TYPES):
            kind = joint.attributes["type"]
            if not joint.attributes.get("name") or (kind == "floating" and specifies_base(case, joint)):
                continue
            if self.chosen(case) == "fixed":
                edits: tuple[Edit, ...] = (case.source.attribute_edit(joint, "type", "fixed"),)
            else:
                edits = tuple(joint_split(case.source, joint))
            yield correction(joint, f"the joint is {kind}", *edits)


class FloatingJointAtRoot(EditingRule):
    """DX211 floating-joint-at-root: A floating joint below an empty root specifies a floating base in the
    file.

    In some files of floating robots the root is a link ``world`` without inertia. A joint of type
    ``floating`` connects the robot to this link. But the call that loads a file also states whether the base
    floats.

    - PyBullet 3.2.7 makes the joint fixed, and prints one line on stdout. Then ``useFixedBase`` decides.
    - Pinocchio 4.1 gives the joint seven coordinates. ``JointModelFreeFlyer`` as a root joint gives seven
      more. The dynamics of the other joints is right if you hold the first seven coordinates.
    - MuJoCo 4.0 makes it a free joint.
    - Drake 1.51 does not support the type. It leaves the child free in the world, with a quaternion of zeros.

    dynx reads the joint as fixed. In dynx only the argument ``base`` says whether the base floats.

    What to do: specify the base only in the call. ``dynx doctor --fix`` makes the joint fixed. Some engines
    took the floating base from the file. They then fix the robot to the world, unless the call says
    otherwise. So this remedy counts as a change of the physics (``--level physics``).
    """

    # Before the rules about inertia, which may give the empty root a body.
    stage = "reading"
    advice = "Make the joint fixed, and specify in the loading call whether the base floats."
    engines = measured_on("mujoco", "drake")
    changed = "made the floating joint below the root fixed: the loading call says whether the base floats"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the joint, of which there is at most one."""
        for joint in joints_of_type(case, ("floating",)):
            if specifies_base(case, joint):
                edit = case.source.attribute_edit(joint, "type", "fixed")
                yield correction(joint, "the joint below the root is floating", edit)


class TooManyJoints(Rule):
    """DX212 too-many-joints: The robot has more joints than PyBullet supports.

    PyBullet 3.2.7 supports 127 joints, including fixed joints. For further joints ``getJointState`` and
    ``getLinkState`` fail, so PyBullet does not return their positions. Above 128 coordinates,
    ``calculateInverseDynamics``, ``calculateMassMatrix`` and ``calculateJacobian`` return wrong results
    without a warning (an error of 20 % at 129 coordinates). Hands with sensors, and robots with many named
    frames, may have too many joints. For example, ``tiago_dual`` of example-robot-data has 129 joints.

    Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 have no such limit.

    What to do: drop frames that PyBullet does not need. Here a frame is a link at the end of a chain, without
    mass, on a fixed joint. ``dynx doctor --fix`` removes frames until 127 joints remain. It begins with
    frames without shapes, and at the end of the file. The dynamics does not change. Programs that use these
    frames need the original file. ``--choose DX212=keep`` keeps the frames, and PyBullet cannot load the
    robot. If the file has too few such frames, or more than 127 joints move, there is no remedy.
    """

    advice = "Remove links that are only frames from the file for PyBullet."
    engines = measured_on("pybullet")
    choices = {
        "drop": "remove frames without mass at the ends of the robot until 127 joints are left",
        "keep": "keep all links; PyBullet then cannot load the robot",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first joint too many, in document order."""
        joints = case.source.root.all("joint")
        if len(joints) <= MAX_JOINTS:
            return []
        message = f"the robot has {len(joints)} joints, fixed ones included; PyBullet accepts {MAX_JOINTS}"
        return [Detection(None, None, joints[MAX_JOINTS].line, message)]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Remove as many links without mass as there are joints too many."""
        excess = len(case.joints) - MAX_JOINTS
        if self.chosen(case) == "keep" or excess <= 0:
            return None
        dropped = _removable_frames(case)[:excess]
        if len(dropped) < excess:
            return None
        source, carriers = case.source, {joint.child: joint.name for joint in case.model.joints}
        edits = []
        for name in dropped:
            edits += [source.removal(case.links[name]), source.removal(case.joints[carriers[name]])]
        return Remedy(
            case.with_source(source.apply(*edits)),
            f"removed {len(dropped)} links that are mere frames",
            self.decision(case),
        )


def _removable_frames(case: Case) -> list[str]:
    """List the links that can be removed, each before its parent: those without shapes first, the last of the
    document before others."""
    plain: list[str] = []
    shaped: list[str] = []
    for name in _massless_ends(case.model):
        shapes = case.links[name].all("visual") + case.links[name].all("collision")
        (shaped if shapes else plain).append(name)
    return plain + shaped


def _massless_ends(model: Model) -> Iterator[str]:
    attached = dict.fromkeys((link.name for link in model.links), 0)
    for joint in model.joints:
        attached[joint.parent] += 1
    links = {link.name: link for link in model.links}
    # Depth-first order lists a link before what hangs on it, so backwards the ends come first.
    for joint in reversed(model.joints):
        if joint.type == "fixed" and not attached[joint.child] and not _has_inertia(links[joint.child]):
            attached[joint.parent] -= 1
            yield joint.child


def _has_inertia(link: Link) -> bool:
    inertial = link.inertial
    return inertial is not None and (inertial.mass != 0.0 or bool(inertial.tensor.any()))


class LoopJoint(EditingRule):
    """DX220 loop-joint: A ``<loop_joint>`` closes a kinematic loop, which URDF cannot express.

    A robot in URDF is a tree. ``<loop_joint>`` is an extension of a few programs, such as Isaac Sim and the
    predecessor of Drake's ``MultibodyPlant``. It connects two further links (``<link1>``, ``<link2>``), and
    so closes a loop.

    - Drake 1.51 refuses the file: "loop joints are not supported in MultibodyPlant".
    - Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore the element without a warning, and load the open
      tree. dynx does the same, with a note.

    What to do: close the loop in your program by a constraint of your engine. This is ``createConstraint`` in
    PyBullet, ``<equality>`` in MJCF, and a ball or weld constraint in Drake and Pinocchio.
    ``dynx doctor --fix`` removes the element, so that all engines load the open tree. ``--choose DX220=keep``
    keeps the element for programs that read it; Drake then refuses the file.
    """

    stage = "reading"
    advice = "Remove the <loop_joint> and close the loop in the program."
    engines = measured_on("drake")
    choices = {
        "remove": "remove loop joints; the tree remains",
        "keep": "keep loop joints; Drake then refuses the file",
    }
    changed = "removed loop joints"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every such element of the robot."""
        for loop in case.source.root.all("loop_joint"):
            name = shown(loop.attributes.get("name", ""))
            message = f"<loop_joint> {name} closes a loop, which no engine reads"
            yield correction(loop, message, case.source.removal(loop))


_WORLD = "world"


class WorldNotDeclared(EditingRule):
    """DX221 world-not-declared: A joint has the parent ``world``, which is not a link of the file.

    In Drake the link ``world`` is the world itself, and a file need not declare it. So a file written for
    Drake may fix its first link only by ``<parent link="world"/>``. In URDF every parent must be a link of
    the file.

    - Drake 1.51 reads the file, and attaches the joint to its world.
    - Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and dynx refuse the file, because no link has this name.

    What to do: declare ``<link name="world"/>``. ``dynx doctor --fix`` declares it, at the beginning of the
    robot. All engines then read the robot that Drake reads. Load such a robot with a fixed base. With a
    floating base the link ``world`` would float, see DX109.
    """

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


class SeveralRootLinks(EditingRule):
    """DX223 several-root-links: A link is not the child of a joint, and is not the root of the robot.

    A robot in URDF is one tree. The file has a second tree if the joint of a link was forgotten or commented
    out, or if someone added a table to the file.

    - Pinocchio 4.1 refuses the file ("two root links found"). PyBullet 3.2.7 ends the process with a crash.
    - MuJoCo 4.0 fixes every such link to its world, at the origin.
    - Drake 1.51 loads all trees. The usual call fixes the root of one tree, and the other trees float.

    dynx refuses the file.

    What to do: add the joint, or write two files. The file does not say where the link belongs, so
    ``dynx doctor --fix`` attaches it to the root by a fixed joint without offset, as MuJoCo does.
    ``--choose DX223=remove`` removes the smaller trees instead. In both cases the tree with the most links is
    the robot. If several trees have the same number of links, the first of them is the robot.
    """

    stage = "reading"
    advice = "Add the joint that is missing, or write a file for each tree."
    engines = measured_on("pinocchio", "pybullet", "drake")
    choices = {
        "attach": "attach a link without joint to the root by a fixed joint, at the origin of the root",
        "remove": "remove the trees that are not attached to the root",
    }
    changed = "attached links without joint to the root, or removed them"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the roots but that of the largest tree."""
        trees = _links_by_root(case)
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
            f"  <parent link={quoteattr(main)}/>",
            f"  <child link={quoteattr(root)}/>",
            "</joint>",
        ]
        yield source.insertion_after(case.links[root], "\n".join(lines))


def _links_by_root(case: Case) -> dict[str, list[str]]:
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


_JOINT_TAG = "drake:joint"


class JointOfDrake(EditingRule):
    """DX227 joint-of-drake: A <drake:joint> connects two links; only Drake reads it.

    Drake has joints that URDF lacks: ball, universal, planar, screw and curvilinear joints. A file states
    such a joint in the element ``<drake:joint name="..." type="ball">``, with the same children as
    ``<joint>``.

    - Drake 1.51.1 adds the joint. If another joint already has the same child link, it refuses the file
      ("form one or more loops").
    - Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore the element, and dynx ignores it with a note. If no
      other joint has this child link, the link is then the root of a second tree (DX223).

    What to do: write a chain of URDF joints with small links between them (see DX210), or use the file with
    Drake alone. ``dynx doctor --fix`` removes the element, because a chain cannot replace every type, such as
    a screw. The remedy of DX223 then attaches the child link. ``--choose DX227=keep`` keeps the element;
    Drake then loads another robot than the other engines.
    """

    stage = "reading"
    advice = "Write joints that URDF has, or use the file with Drake alone."
    engines = measured_on("drake")
    choices = {
        "remove": "remove joints that only Drake reads",
        "keep": "keep such joints; Drake then loads another robot",
    }
    changed = "removed joints that only Drake reads"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every such element of the robot."""
        for joint in case.source.root.all(_JOINT_TAG):
            kind, name = (shown(joint.attributes.get(key, "")) for key in ("type", "name"))
            message = f"<{_JOINT_TAG}> {name} of type {kind} is a joint in Drake alone"
            yield correction(joint, message, case.source.removal(joint))
