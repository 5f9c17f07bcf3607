"""What importers of MJCF leave out or read otherwise than MuJoCo does: each place can be written out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import ClassVar

import numpy as np

from dynx.errors import shown
from dynx.model.document_format import Format
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.vocabulary import attributes_with_commas
from dynx.model.xml.reading import Element
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import CallingRule, Case, Correction, Detection, EditingRule, Rule, measured_on
from dynx.rules.mjcf import (
    BodyInText,
    bodies_in_text,
    decimals,
    found_in,
    inertial_text,
    mjcf_text,
    parts_of_bodies,
    quaternion_text,
    with_defaults,
)
from dynx.spatial.scalar import Floats

_ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


def _stated_inertial(case: Case, body: BodyInText) -> list[Edit] | None:
    """Return the edits that state the inertia of a body as dynx reads it; None where it has none."""
    names = {link.name for link in case.model.links}
    inertial = case.model.link(body.name).inertial if body.name in names else None
    if inertial is None or not inertial.mass:
        return None
    text = inertial_text(inertial)
    given = body.element.first("inertial")
    source = case.source
    if given is None:
        return [source.insertion(body.element, text, first=True)]
    return [source.replacement(given, text)]


class InertiaByDefaultClass(EditingRule):
    """DX601 inertia-by-default-class: The mass of a body follows from geoms that take attributes from a class
    of defaults, which not every importer applies.

    ``<default class="part"><geom mass="2"/></default>`` gives a mass to each ``<geom class="part"/>``.

    - MuJoCo 4.0 applies all attributes of a class. A class inherits the attributes of the class that contains
      it.
    - Pinocchio 4.1 (``buildModelFromMJCF``) applies the density and the size of a class, but not its mass,
      type, position or orientation. If only the class states the mass, Pinocchio computes the mass from the
      density of water.
    - Drake 1.51 loses inherited attributes if one of the nested classes has no ``<geom>``.
    - PyBullet 3.2.7 (``loadMJCF``) applies only few attributes of a class.

    The effect: the mass of the body is wrong by any factor.

    What to do: write an ``<inertial>`` for the body. ``dynx doctor --fix`` writes it, with the numbers that
    MuJoCo computes from the geoms. All engines read it.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write an <inertial> for each body."
    engines = measured_on("pinocchio", "pybullet", "drake")
    changed = "wrote the inertia that follows from geoms"

    _APPLIED = ("mass", "density", "type", "size", "fromto", "pos", "mesh", *_ORIENTATIONS)

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies without an inertial of their own, with a geom that takes such an attribute."""
        document = mjcf_text(case)
        if document.compiler.inertia_from_geom == "true":
            return
        for body in bodies_in_text(case, document):
            if body.element.first("inertial") is not None:
                continue
            for geom in body.children("geom"):
                resolved = with_defaults(document, geom, body.childclass)
                taken = [name for name in self._APPLIED if name in resolved and name not in geom.attributes]
                edits = _stated_inertial(case, body) if taken else None
                if edits:
                    message = f"a geom takes {' and '.join(taken)} from a class of defaults"
                    yield Correction(Detection(body.name, None, geom.line, message), tuple(edits))
                    break


_SETTINGS = {
    "inertiagrouprange": ("inertia_groups", (0.0, 5.0)),
    "boundmass": ("bound_mass", 0.0),
    "boundinertia": ("bound_inertia", 0.0),
    "balanceinertia": ("balance_inertia", False),
    "settotalmass": ("total_mass", -1.0),
}


class InertiaByCompilerSetting(EditingRule):
    """DX602 inertia-by-compiler-setting: A setting of the compiler changes masses or inertias, and importers
    ignore it.

    ``<compiler>`` has settings that change masses. ``inertiagrouprange`` selects the geoms that have a mass.
    ``boundmass`` and ``boundinertia`` raise small masses and moments. ``balanceinertia`` replaces impossible
    moments. ``settotalmass`` scales all masses and moments.

    - MuJoCo 4.0 applies all these settings.
    - Pinocchio 4.1 (``buildModelFromMJCF``) applies only ``boundmass`` and ``boundinertia``.
    - Drake 1.51 applies no such setting, and refuses moments that ``balanceinertia`` would replace.
    - PyBullet 3.2.7 (``loadMJCF``) applies no such setting.

    The effect: other engines have other masses or inertias than MuJoCo. ``settotalmass`` changes the mass of
    the whole robot.

    What to do: write an ``<inertial>`` with the final numbers for each body, as ``dynx doctor --fix`` does.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write the final inertia of each body, and no setting that changes it."
    engines = measured_on("pinocchio", "drake", "pybullet")
    changed = "wrote the inertia with the settings of <compiler> applied"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies whose inertia is not yet stated as the settings make it."""
        document = mjcf_text(case)
        given = [
            name for name, (field, plain) in _SETTINGS.items() if getattr(document.compiler, field) != plain
        ]
        if not given:
            return
        settings = " and ".join(given)
        for body in bodies_in_text(case, document):
            edits = _stated_inertial(case, body)
            if not edits or _is_stated(case, body, document):
                continue
            message = f"{settings} of <compiler> acts on the inertia of the body"
            yield Correction(Detection(body.name, None, body.element.line, message), tuple(edits))


def _is_stated(case: Case, body: BodyInText, document: MjcfText) -> bool:
    """Check whether a body states its final inertia itself."""
    given = body.element.first("inertial")
    if given is None or document.compiler.inertia_from_geom == "true" or body.name is None:
        return False
    inertial = case.model.inertial(body.name)
    mass = float(given.attributes.get("mass", "nan"))
    words = given.attributes.get("diaginertia", given.attributes.get("fullinertia", "")).split()
    moments = [float(word) for word in words][:3]
    held = (
        np.diagonal(inertial.tensor)
        if "diaginertia" in given.attributes
        else np.diagonal(inertial.link_tensor)
    )
    close = np.allclose(moments, held, rtol=1e-14, atol=0.0) if len(moments) == 3 else False
    return abs(mass - inertial.mass) <= 1e-14 * inertial.mass and bool(close)


class OrientationOtherThanQuaternion(EditingRule):
    """DX603 orientation-other-than-quaternion: An orientation is not a quaternion, and some importers read it
    differently.

    MJCF has five attributes for an orientation: ``quat``, ``axisangle``, ``euler``, ``xyaxes`` and ``zaxis``.
    The setting ``eulerseq`` states the sequence of the angles of ``euler``.

    - MuJoCo 4.0 and Drake 1.51 read all five in the same way.
    - Pinocchio 4.1 (``buildModelFromMJCF``) does not normalise the axis of ``axisangle``. In ``eulerseq`` it
      reads capital letters (fixed axes) as small letters (axes that rotate with the frame).
    - PyBullet 3.2.7 (``loadMJCF``) reads only ``quat`` correctly. It reads angles of ``euler`` with the
      opposite sign or as degrees, and drops the other three attributes.

    The effect: the body, and all bodies that it carries, have another pose.

    What to do: write ``quat``, as ``dynx doctor --fix`` does.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write orientations as quat."
    engines = measured_on("pinocchio", "pybullet")
    changed = "wrote orientations as quaternions"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies and inertials with another attribute."""
        document = mjcf_text(case)
        for body in bodies_in_text(case, document):
            for element in (body.element, *body.children("inertial")):
                given = [name for name in _ORIENTATIONS[1:] if name in element.attributes]
                if len(given) != 1:
                    continue
                plain = Element(element.tag, dict(element.attributes), element.line)
                R = document.rotation(plain, "the body")
                message = f"{given[0]} states the orientation"
                yield Correction(
                    Detection(body.name, None, element.line, message),
                    (
                        case.source.attribute_removal(element, given[0]),
                        case.source.attribute_edit(element, "quat", quaternion_text(R)),
                    ),
                )


class InertiaNotPrincipal(EditingRule):
    """DX611 inertia-not-principal: An ``<inertial>`` of MJCF has products of inertia, which PyBullet
    drops.

    The attribute ``fullinertia`` states the six entries of a tensor. The attribute ``diaginertia`` states
    three moments about the axes of the ``<inertial>``.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 read both attributes.
    - PyBullet 3.2.7 (``loadMJCF``) stores an inertial frame and three moments for each body. It reads the
      orientation of the frame from the file. The remedy of DX610 sets the moments, but cannot set products of
      inertia.

    The effect: the products of inertia are lost.

    What to do: write ``diaginertia`` about the principal axes, as ``dynx doctor --fix`` does.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write diaginertia about principal axes."
    engines = measured_on("pybullet")
    changed = "wrote inertias about principal axes"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield inertials with products of inertia."""
        document = mjcf_text(case)
        for body in bodies_in_text(case, document):
            for inertial in body.children("inertial"):
                words = inertial.attributes.get("fullinertia", "").split()
                numbers = [float(word) for word in words]
                if len(numbers) != 6 or not any(numbers[3:]):
                    continue
                xx, yy, zz, xy, xz, yz = numbers
                moments, axes = np.linalg.eigh(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
                axes = axes * np.sign(np.linalg.det(axes))
                source = case.source
                yield Correction(
                    Detection(body.name, None, inertial.line, "the inertial has products of inertia"),
                    (
                        source.attribute_removal(inertial, "fullinertia"),
                        source.attribute_edit(inertial, "diaginertia", decimals(moments)),
                        source.attribute_edit(inertial, "quat", quaternion_text(axes)),
                    ),
                )


class SeveralJointsInBody(EditingRule):
    """DX607 several-joints-in-body: A body with an offset from its parent has several joints, which Drake
    places elsewhere.

    A body of MJCF may have several joints, which act one after the other. For example, three hinges are a
    wrist.

    - MuJoCo 4.0, Pinocchio 4.1 and PyBullet 3.2.7 (``loadMJCF``) place all joints at the body.
    - Drake 1.51 adds bodies between these joints, such as ``wrist0`` and ``wrist1``. It places all joints
      except the last at the origin of the parent. The offset of the body (``pos`` and orientation) comes
      after these joints. So the body rotates about the origin of its parent.

    The effect: the body, and all bodies that it carries, have another pose.

    What to do: write two nested bodies, as ``dynx doctor --fix`` does. The outer body has the pose and no
    joints, and the inner body has the joints.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Put the body into an outer body that has its pose and no joints."
    engines = measured_on("drake")
    changed = "put bodies with several joints into bodies that have their places"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies with several joints that are not at their parent."""
        document = mjcf_text(case)
        taken = {body.name for body in bodies_in_text(case, document)}
        for body in bodies_in_text(case, document):
            element, joints = body.element, body.children("joint")
            place = [name for name in ("pos", *_ORIENTATIONS) if name in element.attributes]
            at_parent = place == ["pos"] and not any(map(float, element.attributes["pos"].split()))
            if len(joints) < 2 or not place or at_parent:
                continue
            given = "".join(f' {name}="{element.attributes[name]}"' for name in place)
            outer = f"{body.name}_place"
            named = f' name="{outer}"' if body.name and outer not in taken else ""
            edits = [case.source.attribute_removal(element, name) for name in place]
            edits.append(Edit(element.span.start, element.span.start, f"<body{named}{given}>"))
            edits.append(Edit(element.span.end, element.span.end, "</body>"))
            message = f"the body has {len(joints)} joints, and is not at the origin of its parent"
            yield Correction(Detection(body.name, None, joints[0].line, message), tuple(edits))


class FrameOfBodies(Rule):
    """DX608 frame-of-bodies: A ``<frame>`` or ``<replicate>`` contains bodies, which importers ignore.

    ``<frame pos="0 0 1">`` moves its contents. ``<replicate count="4" euler="0 0 90">`` repeats its contents.

    - MuJoCo 4.0 reads both.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) ignore the element
      with all bodies, joints and geoms in it. Drake prints a warning.

    The effect: in these engines the robot lacks the bodies. If it lacks a joint, the doctor does not use the
    engine.

    What to do: write the bodies with their own poses. MuJoCo's ``mj_saveLastXML`` and
    ``dynx convert --to mjcf`` write such a file. ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Write the bodies with their own poses (dynx convert --to mjcf)."
    engines = measured_on("pinocchio", "drake", "pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield frames and replicates that hold parts of bodies."""
        for tree in case.source.root.all("worldbody"):
            for element in tree.walk():
                if element.tag in ("frame", "replicate") and element.children:
                    yield Detection(None, None, element.line, f"a <{element.tag}> holds parts of the robot")


class SeveralBodiesInWorld(Rule):
    """DX609 several-bodies-in-world: The world has several bodies, and Pinocchio loads only the first.

    Besides the robot, ``<worldbody>`` may contain a table, a floor or a second robot.

    - MuJoCo 4.0 and Drake 1.51 load all bodies.
    - Pinocchio 4.1 (``buildModelFromMJCF``) loads the first body of the world and the bodies that it carries.
      It drops the other bodies without a message.
    - PyBullet 3.2.7 (``loadMJCF``) loads each body as a robot, and returns several robots.

    For example, if the table comes first, the robot in Pinocchio has no joint.

    What to do: put the robot first. Or put it into a file of its own, and include this file in the scene. The
    order of bodies determines the order of coordinates, so ``dynx doctor --fix`` does not change it.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    advice = "Put the robot first, or into a file of its own."
    engines = measured_on("pinocchio")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the second body of the world, where a body of the robot is not in the first."""
        bodies = [body for tree in case.source.root.all("worldbody") for body in tree.all("body")]
        for body in bodies[1:]:
            if any(each.tag == "joint" for each in body.walk()):
                name = body.attributes.get("name")
                yield Detection(name, None, body.line, "the body is not the first of the world")


class MjcfInSinglePrecision(Rule):
    """DX612 mjcf-in-single-precision: PyBullet reads the numbers of MJCF in single precision.

    A number such as 0.1 has no exact binary form. In double precision it is off by 1e-17, and in single
    precision by 1e-9.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 read double precision. MuJoCo holds meshes in single precision.
    - PyBullet 3.2.7 (``loadMJCF``) reads positions, orientations, axes and sizes in single precision.

    The effect: every quantity has an error of about 1e-8. This is too small to see in a simulation. But in a
    comparison with the tolerance 1e-12, it hides other differences.

    What to do: compare with ``--tolerance 1e-6``. An edit of the file cannot remove the cause. So the report
    measures the effect as the difference that remains after all other causes are removed.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_bound = 1e-5
    advice = "Compare PyBullet's reading of MJCF with a tolerance of 1e-6."
    engines = measured_on("pybullet")

    _READ = ("pos", "quat", "axis", "mass")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first number that single precision does not hold."""
        for tree in case.source.root.all("worldbody"):
            for element in tree.walk():
                for name in self._READ if element.tag in ("body", "joint", "inertial") else ():
                    for word in element.attributes.get(name, "").split():
                        if float(np.float32(float(word))) != float(word):
                            message = f"{word} is read as {float(np.float32(float(word))):.10g}"
                            yield Detection(None, None, element.line, message)
                            return


class JointByDefaultClass(EditingRule):
    """DX604 joint-by-default-class: A joint takes attributes from a class of defaults, which not every
    importer applies.

    ``<default><joint type="slide" axis="0 0 1"/></default>`` makes every joint slide along z.

    - MuJoCo 4.0 and Drake 1.51 apply classes to all attributes of joints.
    - Pinocchio 4.1 (``buildModelFromMJCF``) does not apply ``pos``, so the axis passes through the origin of
      the body.
    - PyBullet 3.2.7 (``loadMJCF``) does not apply ``type``, ``axis``, ``pos`` and ``range``. It ignores a
      joint without a type of its own, so the body is fixed (DX605).

    The effect: the joint has another axis, or the robot lacks the joint.

    What to do: write these attributes in the ``<joint>``, as ``dynx doctor --fix`` does.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write type, axis, pos and range at each joint."
    engines = measured_on("pinocchio", "pybullet")
    changed = "wrote attributes of classes of defaults at the joints"

    _APPLIED = ("type", "axis", "pos", "ref", "range", "limited")

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints that take such an attribute from a class."""
        document = mjcf_text(case)
        for body, joint in _joints_in_text(case, document):
            resolved = with_defaults(document, joint, body.childclass)
            taken = [name for name in self._APPLIED if name in resolved and name not in joint.attributes]
            if taken:
                edits = tuple(case.source.attribute_edit(joint, name, resolved[name]) for name in taken)
                message = f"the joint takes {' and '.join(taken)} from a class of defaults"
                yield Correction(Detection(None, joint.attributes.get("name"), joint.line, message), edits)


class JointWithoutType(EditingRule):
    """DX605 joint-without-type: A joint states no type, and PyBullet ignores it.

    In MJCF the default type of a ``<joint>`` is ``hinge``.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 read a hinge.
    - PyBullet 3.2.7 (``loadMJCF``) prints "expected 'type' attribute for joint" and ignores the joint. Its
      body is then fixed to its parent.

    Most files state no type for hinges. PyBullet then loads the robot without any joint.

    What to do: write ``type="hinge"``, as ``dynx doctor --fix`` does.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = 'Write type="hinge".'
    engines = measured_on("pybullet")
    changed = 'wrote type="hinge" at joints without a type'

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints without a type, of their own or of their class."""
        document = mjcf_text(case)
        for body, joint in _joints_in_text(case, document):
            if "type" not in with_defaults(document, joint, body.childclass):
                edit = case.source.attribute_edit(joint, "type", "hinge")
                detection = Detection(
                    None, joint.attributes.get("name"), joint.line, "the joint states no type"
                )
                yield Correction(detection, (edit,))


class JointWithoutName(EditingRule):
    """DX606 joint-without-name: A joint has no name, so each engine gives it another name.

    Names of joints are optional in MJCF.

    - MuJoCo 4.0 gives the joint only a number.
    - Pinocchio 4.1 (``buildModelFromMJCF``), Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) generate different
      names from the names of bodies or from numbers: ``leg_joint_0``, ``trunk-leg``, ``joint2_4_2``.

    A program cannot find the joint by the same name in two engines.

    What to do: name every joint. ``dynx doctor --fix`` writes the name that dynx gives the joint.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Name every joint."
    engines = measured_on("pinocchio", "drake", "pybullet")
    changed = "named joints"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints without a name that are not free."""
        document = mjcf_text(case)
        names = {joint.line: joint.name for joint in case.model.joints if joint.moves}
        counts: dict[int, int] = {}
        for _, joint in _joints_in_text(case, document):
            counts[joint.line] = counts.get(joint.line, 0) + 1
        for body, joint in _joints_in_text(case, document):
            if "name" in joint.attributes:
                continue
            name = names.get(joint.line) if counts[joint.line] == 1 else None
            edits = () if name is None else (case.source.attribute_edit(joint, "name", name),)
            of_body = f" of body {shown(body.name)}" if body.name else ""
            detection = Detection(body.name, None, joint.line, f"a joint{of_body} has no name")
            yield Correction(detection, edits)


class InertiaFromShapesOfMjcf(CallingRule):
    """DX610 inertia-from-shapes-of-mjcf: PyBullet computes inertias from shapes, and ignores the moments of
    an ``<inertial>``.

    ``<inertial mass="2" diaginertia="0.1 0.1 0.2"/>`` states the mass and the moments of a body.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 read both.
    - PyBullet 3.2.7 (``loadMJCF``) reads the mass and the centre of mass. It computes the moments from the
      bounding box of the shapes. Without shapes the moments are 0. For a body without ``<inertial>`` it
      computes the mass from a density of 1000 kg/m^3, and ignores the attribute ``mass`` of a geom. With the
      flag ``URDF_USE_INERTIA_FROM_FILE`` all moments are 0.

    The effect: every body has another inertia. In most robots the mass matrix is off by tens of per cent.

    What to do: set the masses and the moments after loading. Or convert the file to URDF
    (``dynx convert --to urdf``), and load this URDF file with the flag. The file is correct, so
    ``dynx doctor --fix`` does not change the file. The doctor prints the call that sets the masses and the
    moments.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Set mass and moments after loading, or load a URDF (dynx convert --to urdf)."
    engines = measured_on("pybullet")
    calls = ("pybullet.set_inertias",)
    changed = "compared with the masses and moments of the file"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield bodies whose moments are not those of one box that is all their shape."""
        document = mjcf_text(case)
        boxes = {body.name: _moments_of_box(body) for body in bodies_in_text(case, document)}
        for link in case.model.links:
            inertial = link.inertial
            if inertial is None or not inertial.mass:
                continue
            ratio, tensor = boxes.get(link.name), inertial.link_tensor
            if ratio is not None and np.allclose(
                np.diag(ratio) * inertial.mass, tensor, rtol=1e-12, atol=0.0
            ):
                continue
            message = f"the body has {inertial.mass:.4g} kg and moments of its own"
            yield Detection(link.name, None, link.line, message)


def _moments_of_box(body: BodyInText) -> Floats | None:
    """Return the moments (3,) of the one box of a body, for 1 kg; None for other shapes, and for a body that
    states no inertial."""
    geoms = body.children("geom", "frame")
    # PyBullet does not apply classes of defaults to these.
    given = geoms[0].attributes if len(geoms) == 1 else {}
    stated = body.element.first("inertial") is not None
    if not stated or given.get("type") != "box" or any(name in given for name in _ORIENTATIONS):
        return None
    half = np.array([float(word) for word in given.get("size", "").split()])
    if half.shape != (3,):
        return None
    return np.asarray((half @ half - half**2) / 3.0)


def _joints_in_text(case: Case, document: MjcfText) -> Iterator[tuple[BodyInText, SourceElement]]:
    """Yield the joints that turn or slide, with their bodies."""
    for body in bodies_in_text(case, document):
        for joint in body.children("joint"):
            if with_defaults(document, joint, body.childclass).get("type") != "free":
                yield body, joint


class IncludeOfMjcf(Rule):
    """DX613 include-of-mjcf: The file includes another file, which some engines ignore.

    ``<include file="robot.xml"/>`` inserts the contents of another file. Usually the file of a scene includes
    the file of a robot.

    - MuJoCo 4.0 and Drake 1.51 read the other file.
    - Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) ignore the element, so the
      robot lacks the bodies of the other file. PyBullet prints "unknown field 'include'".

    What to do: load the file of the robot itself, or write one file without ``<include>``. MuJoCo's
    ``mj_saveLastXML`` and ``dynx convert --to mjcf`` write such a file. ``dynx doctor --fix`` does not change
    the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Load the file of the robot itself, or write one file (dynx convert --to mjcf)."
    engines = measured_on("pinocchio", "pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the includes of the file."""
        for element in case.source.root.walk():
            if element.tag == "include":
                name = element.attributes.get("file", "")
                yield Detection(None, None, element.line, f"the file includes {shown(name, 200)}")


class ModelWithoutName(EditingRule):
    """DX614 model-without-name: The model has no name, so Drake refuses the file.

    The attribute ``model`` of ``<mujoco>`` is optional.

    - MuJoCo 4.0 then calls the model ``MuJoCo Model``. Pinocchio 4.1 and PyBullet 3.2.7 need no name.
    - Drake 1.51 refuses the file: "Your robot must have a name attribute or a model name must be specified".

    What to do: write a name. ``dynx doctor --fix`` writes ``model="robot"``.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write the attribute model of the root element."
    engines = measured_on("drake")
    changed = 'wrote model="robot"'

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield a root without a name."""
        root = case.source.root
        if not root.attributes.get("model"):
            detection = Detection(None, None, root.line, "the model has no name")
            yield Correction(detection, (case.source.attribute_edit(root, "model", "robot"),))


class WorldWithoutBody(Rule):
    """DX615 world-without-body: The world has no body, so some engines refuse the file.

    If a file describes only a floor, a table or settings, its ``<worldbody>`` has only geoms, or is empty.

    - MuJoCo 4.0 and Drake 1.51 read a world in which nothing moves.
    - PyBullet 3.2.7 (``loadMJCF``) reads it if there is a geom, and otherwise loads no body.
    - Pinocchio 4.1 (``buildModelFromMJCF``) raises "No such node (body)" or "no body found in parsed tree".

    What to do: if the file of a robot includes this file, load the file of the robot. Otherwise do nothing.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Load the file that includes this one."
    engines = measured_on("pinocchio", "pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the world without a body."""
        document = mjcf_text(case)
        if next(parts_of_bodies(document, "body"), None) is None:
            yield Detection(None, None, case.source.root.line, "the world has no body")


class MeshOfMjcfNotObj(Rule):
    """DX616 mesh-of-mjcf-not-obj: A mesh is not an OBJ file, so Drake refuses the file.

    MuJoCo reads meshes in STL, OBJ and its own format MSH.

    - MuJoCo 4.0 reads the mesh. Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) load
      the robot without the mesh.
    - Drake 1.51 refuses the file, even if no geom uses the mesh: "Drake's MuJoCo parser currently only
      supports mesh files in .obj format".

    What to do: convert the meshes to OBJ, or the robot to URDF (``dynx convert --to urdf``).
    ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Convert the meshes to OBJ."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield meshes of other formats."""
        document = mjcf_text(case)
        for mesh, file, _ in _mesh_assets(document):
            if not file.lower().endswith(".obj"):
                yield found_in(document, mesh, f"the mesh {shown(file, 200)} is no OBJ file")


class MeshOfMjcfNotFound(Rule):
    """DX617 mesh-of-mjcf-not-found: The file of a mesh is not where the model says.

    The path in ``<mesh file="arm.obj"/>`` is relative to the folder ``meshdir`` of the compiler. ``meshdir``
    is relative to the folder of the file.

    - MuJoCo 4.0 refuses the file, even if no geom uses the mesh: "Error opening file". Drake 1.51 also
      refuses it: "The mesh asset could not be found".
    - Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) load the robot without the
      mesh.

    dynx needs the mesh only if the mass of a body follows from it.

    What to do: put the file there, or correct the path (capital letters matter).
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Put the file there, or correct the path (capital letters matter)."
    engines = measured_on("mujoco", "drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield meshes that are not found."""
        document = mjcf_text(case)
        for mesh, _, reason in _mesh_assets(document):
            if reason:
                yield found_in(document, mesh, reason)


class PlaceOfFixedBody(Rule):
    """DX618 place-of-fixed-body: A body is fixed to the world, and Pinocchio ignores its pose.

    A body of ``<worldbody>`` without a joint is fixed to the world at its ``pos``. Most arms have such a
    base.

    - MuJoCo 4.0 and Drake 1.51 read the pose of this body.
    - Pinocchio 4.1 (``buildModelFromMJCF``) puts this body at the origin, and so moves the whole robot.
    - PyBullet 3.2.7 lets the robot float (DX619).

    The effect: all poses are off by the pose of this body. If the body is rotated, Jacobians and the
    equations of motion also differ.

    What to do: transform the poses in your program, or convert the file to URDF (``dynx convert --to urdf``).
    ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    advice = "Convert the file to URDF for Pinocchio (dynx convert --to urdf)."
    engines = measured_on("pinocchio")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first body of the world, where it is fixed away from the origin."""
        document = mjcf_text(case)
        for body in _fixed_bodies(document):
            if (document.pose(body, "the body") != np.eye(4)).any():
                yield _found_body(document, body, "is fixed to the world away from the origin")


class FixedBodyFloats(Rule):
    """DX619 fixed-body-floats: A body is fixed to the world, and PyBullet lets it float.

    A body of ``<worldbody>`` without a joint is fixed to the world. Most arms have such a base.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 fix it to the world.
    - PyBullet 3.2.7 (``loadMJCF``) makes it the base of the robot. If the base has a mass, the robot floats.
      ``loadMJCF`` has no option ``useFixedBase``.

    The effect: the robot falls, and its mass matrix has six more rows.

    What to do: fix the base to the world by ``p.createConstraint``. Or convert the file to URDF
    (``dynx convert --to urdf``), and load it with ``useFixedBase=True``. ``dynx doctor --fix`` does not
    change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Convert the file to URDF for PyBullet (dynx convert --to urdf)."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first body of the world, where it is fixed."""
        document = mjcf_text(case)
        for body in _fixed_bodies(document):
            yield _found_body(document, body, "is fixed to the world")


class ContactsWithTheWorld(CallingRule):
    """DX620 contacts-with-the-world: The world has shapes, whose contacts PyBullet adds to forward dynamics.

    A ``<geom>`` of ``<worldbody>`` is fixed to the world, for example a floor or a table.

    - PyBullet 3.2.7 (``loadMJCF``) loads it as a body of its own. A step (``stepSimulation``) pushes the
      robot out of this body. Inverse dynamics and the mass matrix have no contacts.
    - MuJoCo 4.0 also has these contacts, even in inverse dynamics (DX308).
    - Pinocchio 4.1 and Drake 1.51 (``CalcInverseDynamics``) compute dynamics without contacts.

    The effect: where the robot reaches into the floor, the acceleration can have any error.

    What to do: find out whether your accelerations include contacts. The file is correct, so
    ``dynx doctor --fix`` does not change the file. The doctor compares without contacts, and prints the call
    that switches them off in PyBullet.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Switch contacts off if you need accelerations of the rigid bodies alone."
    engines = measured_on("pybullet")
    present_as = "contact_forces"
    depends_on_state = True
    calls = ("pybullet.no_contacts",)
    changed = "compared without contacts"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield shapes of the world that may touch others."""
        document = mjcf_text(case)
        for part in parts_of_bodies(document, "geom"):
            touches = any(
                part.resolved.attributes.get(name, "1") != "0" for name in ("contype", "conaffinity")
            )
            if part.bodies == 0 and touches:
                yield found_in(
                    document, part.given, "the shape is fixed to the world, and may touch the robot"
                )


class MassOfGeomWithoutContacts(EditingRule):
    """DX621 mass-of-geom-without-contacts: A geom that touches nothing has a mass, which Pinocchio leaves
    out.

    ``contype="0" conaffinity="0"`` switches the contacts of a geom off. Authors draw parts by such geoms.
    But unless the body has an ``<inertial>``, all its geoms have a mass, also these.

    - MuJoCo 4.0 and Drake 1.51 add the mass of the geom to that of the body.
    - Pinocchio 4.1 (``buildModelFromMJCF``) takes the geom for a mere picture, and leaves its mass out.
    - PyBullet 3.2.7 (``loadMJCF``) ignores the attribute ``mass`` of all geoms (DX610).

    The effect: the body is lighter than in MuJoCo, or has no mass.

    What to do: write an ``<inertial>`` for the body. ``dynx doctor --fix`` writes it, with the numbers that
    MuJoCo computes from the geoms. If the geom should have no mass, write ``mass="0"`` instead.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write an <inertial> for each body, or a mass of 0 for geoms that only draw."
    engines = measured_on("pinocchio")
    changed = "wrote the inertia that follows from geoms"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies without an inertial of their own, with such a geom."""
        document = mjcf_text(case)
        for body, geoms in _bodies_of_geoms(case, document):
            found = [
                geom
                for geom in geoms
                if _touches_nothing(resolved := with_defaults(document, geom, body.childclass))
                and _has_mass(resolved)
            ]
            edits = _stated_inertial(case, body) if found else None
            if edits:
                have = "a geom of the body touches nothing, and has"
                if len(found) > 1:
                    have = f"{len(found)} geoms of the body touch nothing, and have"
                yield Correction(Detection(body.name, None, found[0].line, f"{have} a mass"), tuple(edits))


class CenterOfMassFromGeoms(EditingRule):
    """DX622 center-of-mass-from-geoms: The centre of mass or the principal axes of a body follow from geoms,
    which PyBullet does not compute.

    Without an ``<inertial>``, the centre of mass of a body is that of its geoms.

    - MuJoCo 4.0, Pinocchio 4.1 and Drake 1.51 compute the centre of mass and the inertia tensor from all
      geoms.
    - PyBullet 3.2.7 (``loadMJCF``) puts the centre of mass at the origin of the body. If the last geom is a
      capsule or a cylinder with ``fromto``, it is the middle of that geom. The principal axes are those of
      the body. The remedy of DX610 sets the mass and the moments, but cannot set the centre of mass or the
      axes.

    The effect: gravity and the inertia act at another point. A leg whose shank is a box at
    ``pos="0 0 -0.2"`` hangs from its own centre of mass.

    What to do: write an ``<inertial>`` for the body. ``dynx doctor --fix`` writes it, with the numbers that
    MuJoCo computes from the geoms.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write an <inertial> for each body."
    engines = measured_on("pybullet")
    changed = "wrote the inertia that follows from geoms"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies without an inertial of their own, whose inertia is not about PyBullet's frame."""
        document = mjcf_text(case)
        links = {link.name: link.inertial for link in case.model.links}
        for body, geoms in _bodies_of_geoms(case, document):
            edits = _stated_inertial(case, body)
            inertial = links.get(body.name or "")
            if not edits or inertial is None:
                continue
            tensor, held = inertial.link_tensor, _center_in_pybullet(geoms[-1])
            center = np.asarray(inertial.origin.xyz)
            size = 1e-12 * float(np.trace(tensor))
            faults = {
                "the centre of mass": not np.allclose(center, held, rtol=1e-12, atol=1e-12),
                "the principal axes": bool(np.any(np.abs(tensor - np.diag(np.diagonal(tensor))) > size)),
            }
            found = [name for name, has in faults.items() if has]
            if found:
                verb = "follows" if found == ["the centre of mass"] else "follow"
                message = f"{' and '.join(found)} of the body {verb} from geoms"
                yield Correction(Detection(body.name, None, body.element.line, message), tuple(edits))


class CommasOfIncludedFile(Rule):
    """DX623 commas-of-included-file: A file that the file includes has numbers with commas, so MuJoCo refuses
    the file.

    An example is ``<site size="0.005, 0.005, 0.005"/>`` in the file of a robot, which files of scenes
    include.

    - MuJoCo 4.0 refuses the file: "bad format in attribute 'size'". DX402 describes what the other engines
      read if the commas are in the file itself.
    - Pinocchio 4.1 (``buildModelFromMJCF``) and PyBullet 3.2.7 (``loadMJCF``) ignore the included file
      (DX613).
    - Drake 1.51 refuses commas in the attributes that it reads. It ignores the elements ``<site>`` and
      ``<custom>``.
    - dynx refuses commas in the attributes that it reads, and writes a note about the others.

    What to do: examine the included file, or correct it by hand. ``dynx doctor --fix`` does not change
    included files.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    stated = True
    stated_refusal = True
    advice = "Separate the numbers of the included file only by blanks."
    engines = measured_on("mujoco")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the attributes of included files that have commas."""
        document = mjcf_text(case)
        waiting = [document.root]
        while waiting:
            element = waiting.pop()
            waiting += reversed(element.children)
            if document.reading.source_of(element) != document.reading.source:
                for name in attributes_with_commas(element.tag, element.attributes):
                    text = shown(element.attributes[name])
                    yield found_in(document, element, f"{name} of <{element.tag}> is {text}")


class BoxBetweenPoints(EditingRule):
    """DX624 box-between-points: A box or an ellipsoid extends between two points, and Drake leaves its mass
    out.

    ``<geom type="box" size="0.02" fromto="0 0 0 0 0 0.4"/>`` is a box whose axis z goes from one point to the
    other.

    - MuJoCo 4.0 and Pinocchio 4.1 (``buildModelFromMJCF``) read ``fromto`` of capsules, cylinders, boxes and
      ellipsoids.
    - Drake 1.51 reads it of capsules and cylinders. It ignores other geoms that have it, with a warning ("The
      fromto tag for box is currently unsupported").
    - PyBullet 3.2.7 (``loadMJCF``) also reads no box or ellipsoid of this kind (DX610, DX622).

    The effect: unless the body has an ``<inertial>``, it lacks the mass of the geom.

    What to do: write an ``<inertial>`` for the body, or write ``pos``, ``quat`` and three sizes.
    ``dynx doctor --fix`` writes the ``<inertial>``, with the numbers that MuJoCo computes from the geoms.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Write an <inertial> for each body."
    engines = measured_on("drake")
    changed = "wrote the inertia that follows from geoms"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield bodies without an inertial of their own, with such a geom."""
        document = mjcf_text(case)
        for body, geoms in _bodies_of_geoms(case, document):
            for geom in geoms:
                resolved = with_defaults(document, geom, body.childclass)
                kind = resolved.get("type", "sphere")
                if kind not in ("box", "ellipsoid") or "fromto" not in resolved or not _has_mass(resolved):
                    continue
                if edits := _stated_inertial(case, body):
                    message = f"a geom is a{'n' if kind == 'ellipsoid' else ''} {kind} between two points"
                    yield Correction(Detection(body.name, None, geom.line, message), tuple(edits))
                break


class BaseWithoutName(EditingRule):
    """DX625 base-without-name: The floating base has no name, so some engines give it a name of their own.

    Names of bodies are optional in MJCF. Examples often leave them out.

    - MuJoCo 4.0 gives the body only a number. Pinocchio 4.1 (``buildModelFromMJCF``) has one floating base,
      whatever its name is.
    - Drake 1.51 and PyBullet 3.2.7 (``loadMJCF``) give the body names of their own. ``loadMJCF`` returns
      several bodies, for example a floor and the robot.

    A program cannot find the body by the same name in two engines. The doctor does not use an engine in which
    it does not find the floating base. In PyBullet, the doctor also finds a robot by the names of its joints.

    What to do: name every body. ``dynx doctor --fix`` writes the name that dynx gives the base.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    trap_base = "floating"
    advice = "Name every body."
    engines = measured_on("drake", "pybullet")
    changed = "named the floating base"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield a floating base without a name."""
        document = mjcf_text(case)
        for body in bodies_in_text(case, document):
            element = body.element
            if "name" in element.attributes or not case.model.floating or body.name != case.model.root:
                continue
            message = "the floating base has no name"
            edit = case.source.attribute_edit(element, "name", body.name)
            yield Correction(Detection(body.name, None, element.line, message), (edit,))


class InertiaNowhere(EditingRule):
    """DX626 inertia-nowhere: A body states no inertia and has no geoms, so some engines refuse the file.

    With ``<compiler inertiafromgeom="false"/>`` only an ``<inertial>`` gives a body mass. A body that serves
    as a frame needs no mass, and often has no ``<inertial>``.

    - MuJoCo 4.0 and PyBullet 3.2.7 (``loadMJCF``) read the file.
    - Drake 1.51 refuses it: "has no inertial tag and inertiafromgeom=false. You must specify an inertia".
      Pinocchio 4.1 (``buildModelFromMJCF``) refuses it: "Cannot get inertia from geom and no inertia was
      found".

    What to do: leave the setting out if every body with geoms has an ``<inertial>``. It has no effect then.
    ``dynx doctor --fix`` writes ``inertiafromgeom="auto"``, the default. If a body without an ``<inertial>``
    has geoms, write an ``<inertial>`` for each body.
    """

    formats: ClassVar[tuple[Format, ...]] = ("mjcf",)
    advice = "Leave out inertiafromgeom, or write an <inertial> for each body."
    engines = measured_on("pinocchio", "drake")
    changed = 'wrote inertiafromgeom="auto"'

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the setting, if every body with geoms has an inertial of its own and another has none."""
        document = mjcf_text(case)
        without = [each for each in bodies_in_text(case, document) if each.element.first("inertial") is None]
        if not without or any(each.children("geom") for each in without):
            return
        for element in case.source.root.children:
            if element.tag == "compiler" and element.attributes.get("inertiafromgeom") == "false":
                message = f"body {without[0].name!r} has no inertial and no geom"
                edit = case.source.attribute_edit(element, "inertiafromgeom", "auto")
                yield Correction(Detection(None, None, element.line, message), (edit,))


def _bodies_of_geoms(case: Case, document: MjcfText) -> Iterator[tuple[BodyInText, list[SourceElement]]]:
    """Yield the bodies of the text whose inertia follows from geoms, with these geoms, unless a setting makes
    them overrule each ``<inertial>``."""
    if document.compiler.inertia_from_geom == "true":
        return
    for body in bodies_in_text(case, document):
        geoms = body.children("geom")
        if geoms and body.element.first("inertial") is None:
            yield body, geoms


def _touches_nothing(geom: Mapping[str, str]) -> bool:
    """Check whether a geom with these attributes touches nothing but the partners of its pairs."""
    return not any(float(geom.get(name, "1")) for name in ("contype", "conaffinity"))


def _has_mass(geom: Mapping[str, str]) -> bool:
    """Check whether a geom with these attributes has a mass."""
    return geom.get("type") not in ("plane", "hfield") and bool(
        float(geom.get("mass", geom.get("density", "1000")))
    )


def _center_in_pybullet(last: SourceElement) -> Floats:
    """Return the centre of mass (3,) in PyBullet of a body whose last geom is `last`."""
    numbers = [float(word) for word in last.attributes.get("fromto", "").split()]
    if len(numbers) != 6 or last.attributes.get("type") not in ("capsule", "cylinder"):
        return np.zeros(3)
    return np.asarray((np.array(numbers[:3]) + np.array(numbers[3:])) / 2.0)


def _fixed_bodies(document: MjcfText) -> Iterator[Element]:
    """Yield the first body of the world if it has no joint."""
    first = next(parts_of_bodies(document, "body"), None)
    if first is not None and not any(each.tag in ("joint", "freejoint") for each in first.given.children):
        yield first.given


def _found_body(document: MjcfText, body: Element, message: str) -> Detection:
    name = body.attributes.get("name")
    return found_in(document, body, f"the body {message}", link=name)


def _mesh_assets(document: MjcfText) -> Iterator[tuple[Element, str, str]]:
    """Yield each mesh that names a file, with that name and the reason why it is not found, mostly empty."""
    for mesh in document.sections("asset"):
        file = mesh.attributes.get("file", "")
        if mesh.tag == "mesh" and file:
            yield mesh, file, document.find(mesh, document.compiler_of(mesh).mesh_folder, file)[1]
