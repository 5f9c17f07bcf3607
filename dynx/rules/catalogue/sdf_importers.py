"""What importers of SDF leave out or read otherwise than the format says."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar

from dynx.model.document_format import Format
from dynx.model.xml.source import SourceElement
from dynx.rules import CallingRule, Case, Correction, Detection, EditingRule, Rule, measured_on


def _parts(case: Case, tag: str) -> Iterator[SourceElement]:
    """Yield the links or joints of all models in the text, in document order."""
    for element in case.source.root.walk():
        if element.tag == tag and element.parent is not None and element.parent.tag == "model":
            yield element


def _found(element: SourceElement, at: SourceElement, message: str) -> Detection:
    """Return the detection at a part of a link or joint; one of a nested model has no name here."""
    model = element.parent
    nested = model is not None and model.parent is not None and model.parent.tag == "model"
    name = None if nested else element.attributes.get("name")
    link, joint = (name if element.tag == tag else None for tag in ("link", "joint"))
    return Detection(link, joint, at.line, message)


class InertiaFromShapesOfSdf(CallingRule):
    """DX701 inertia-from-shapes-of-sdf: PyBullet computes moments of inertia from shapes, whatever the file
    says.

    ``<inertial>`` of SDF has ``<mass>`` and ``<inertia>`` with six entries.

    - Drake 1.51 reads both.
    - PyBullet 3.2.7 (``loadSDF``) reads the mass and the pose of the inertial. It computes the moments from
      the bounding box of the collision shapes, and has no flag for those of the file. Without shapes they are
      0.

    The effect is the inertia of every link: tens of per cent of the mass matrix for most robots.

    What to do: set the moments of the file after loading, or convert the file to URDF
    (``dynx convert --to urdf``) and load it with ``URDF_USE_INERTIA_FROM_FILE``. The file is correct, so
    ``dynx doctor --fix`` does not change it. The doctor prints the call. Products of inertia remain an error,
    as PyBullet has none.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Set the moments after loading, or load a URDF (dynx convert --to urdf)."
    engines = measured_on("pybullet")
    calls = ("pybullet.set_inertias",)
    changed = "compared with the masses and moments of the file"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield links with a mass, but for a file in which all moments are those of boxes."""
        for link in _parts(case, "link"):
            # A link without an inertial has 1 kg and 1 kg m^2 by the format.
            if not _is_box(case, link):
                yield _found(link, link.first("inertial") or link, "the link has moments of its own")


def _is_box(case: Case, link: SourceElement) -> bool:
    """Check whether the moments of a link are those of the one box that is all its shape."""
    collisions = link.all("collision")
    sizes = [each for shape in collisions for each in shape.walk() if each.tag == "size"]
    name = link.attributes.get("name", "")
    names = {each.name for each in case.model.links}
    if len(collisions) != 1 or len(sizes) != 1 or name not in names:
        return False
    inertial = case.model.inertial(name)
    x, y, z = (each * each / 12.0 for each in map(float, _text(case, sizes[0]).split()))
    wanted = [inertial.mass * each for each in (y + z, x + z, x + y)]
    held = [inertial.ixx, inertial.iyy, inertial.izz]
    close = all(abs(one - other) <= 1e-12 * max(held) for one, other in zip(wanted, held, strict=True))
    return close and not any((inertial.ixy, inertial.ixz, inertial.iyz))


def _text(case: Case, element: SourceElement) -> str:
    """Return the text of an element without children."""
    inside = case.source.data[element.start_tag.end : element.span.end].decode()
    return inside.partition("</")[0].strip()


class AxisWithoutLimit(EditingRule):
    """DX702 axis-without-limit: An axis of SDF has no limit, for which PyBullet refuses the file.

    ``<limit>`` of an ``<axis>`` is optional. Without it a joint is unlimited.

    - Drake 1.51 reads an unlimited joint.
    - PyBullet 3.2.7 (``loadSDF``) refuses the whole file: "Cannot load SDF file". It does so for revolute and
      prismatic joints, and not for continuous ones.

    What to do: write a limit. 1e16 means no limit, by the convention of the format. ``dynx doctor --fix``
    does so.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write <limit> with lower -1e16 and upper 1e16."
    engines = measured_on("pybullet")
    changed = "wrote limits of 1e16 at axes without a limit"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of revolute and prismatic joints without a limit."""
        limit = "<limit><lower>-1e16</lower><upper>1e16</upper></limit>"
        for joint in _parts(case, "joint"):
            axis = joint.first("axis")
            limited = joint.attributes.get("type") in ("revolute", "prismatic")
            if limited and axis is not None and axis.first("limit") is None:
                detection = _found(joint, axis, "the axis has no limit")
                yield Correction(detection, (case.source.insertion(axis, limit),))


class InertialWithoutInertia(EditingRule):
    """DX703 inertial-without-inertia: An inertial of SDF has no inertia, for which PyBullet refuses the file.

    ``<inertial><mass>20</mass></inertial>`` has the moments that the format gives: 1 kg m^2 about each axis.

    - Drake 1.51 reads these.
    - PyBullet 3.2.7 (``loadSDF``) refuses the whole file: "Inertial element must have inertia element".

    The default is seldom what was meant: a link of 20 kg with moments of 1 kg m^2 is some 0.3 m large.

    What to do: write the moments of the link. ``dynx doctor --fix`` writes those of the format.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write the moments of inertia of the link."
    engines = measured_on("pybullet")
    changed = "wrote the moments that the format gives to inertials without them"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield inertials with a mass and no inertia, which are not computed from shapes."""
        inertia = (
            "<inertia><ixx>1</ixx><ixy>0</ixy><ixz>0</ixz><iyy>1</iyy><iyz>0</iyz><izz>1</izz></inertia>"
        )
        for link in _parts(case, "link"):
            inertial = link.first("inertial")
            if inertial is None or inertial.attributes.get("auto") in ("true", "1"):
                continue
            if inertial.first("inertia") is None:
                detection = _found(link, inertial, "the inertial has no inertia")
                yield Correction(detection, (case.source.insertion(inertial, inertia),))


class FramesOfSdf(Rule):
    """DX704 frames-of-sdf: A pose or an axis is stated in a frame that PyBullet does not read.

    SDF states poses in other frames (``relative_to``, ``<frame>``), in degrees or as quaternions, and axes in
    frames of their own (``expressed_in``, ``use_parent_model_frame``). A joint may stand off its child
    (``<pose>``).

    - Drake 1.51 reads all of these.
    - PyBullet 3.2.7 (``loadSDF``) reads six numbers of the pose of a link, in the frame of the model, and the
      axis in the frame of the child. It drops the attributes, and the pose of a joint. A pose without numbers
      ends the process.

    The effect is another pose of the link, or another axis.

    What to do: convert the file to URDF for PyBullet (``dynx convert --to urdf``). ``dynx doctor --fix``
    does not change it. So the effect in a report is what remains of the difference without all other
    causes.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    advice = "Convert the file to URDF for PyBullet (dynx convert --to urdf)."
    engines = measured_on("pybullet")

    _ATTRIBUTES = ("relative_to", "expressed_in", "degrees", "rotation_format", "frame")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield poses and axes in other frames, and joints with a pose."""
        for tag in ("link", "joint"):
            for part in _parts(case, tag):
                for element in part.walk():
                    holder = element.parent.tag if element.parent is not None else ""
                    if element.tag in ("pose", "xyz") and holder in ("link", "joint", "axis", "inertial"):
                        named = [name for name in self._ATTRIBUTES if element.attributes.get(name)]
                        if named or (element.tag == "pose" and holder == "joint"):
                            what = " and ".join(named) if named else "a pose of its own"
                            yield _found(part, element, f"<{element.tag}> of <{holder}> has {what}")
                    elif element.tag == "use_parent_model_frame" and _text(case, element) in ("1", "true"):
                        yield _found(part, element, "the axis is stated in the frame of the model")


class JointToWorld(Rule):
    """DX705 joint-to-world: A joint ties a link to the world, for which PyBullet refuses the file.

    ``<parent>world</parent>`` fixes a robot of SDF to the world.

    - Drake 1.51 welds the link to its world.
    - PyBullet 3.2.7 (``loadSDF``) looks for a link of that name, and refuses the whole file: "Cannot find
      parent link for a joint".

    What to do: convert the file to URDF for PyBullet (``dynx convert --to urdf``), and load it with
    ``useFixedBase=True``. ``dynx doctor --fix`` does not change it, since without the joint the robot is
    free.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    stated = True
    stated_refusal = True
    advice = "Convert the file to URDF for PyBullet (dynx convert --to urdf)."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints whose parent is the world."""
        for joint in _parts(case, "joint"):
            parent = joint.first("parent")
            if parent is not None and _text(case, parent) == "world":
                yield _found(joint, parent, "the parent of the joint is the world")


class SpringOfSdf(Rule):
    """DX706 spring-of-sdf: A joint of SDF has a spring, which Drake adds to the torque.

    ``<spring_stiffness>`` and ``<spring_reference>`` in ``<dynamics>`` of an axis are a spring.

    - Drake 1.51 makes a force element of it, which inverse dynamics with force elements and forward dynamics
      have.
    - PyBullet 3.2.7 (``loadSDF``) drops it.

    The effect is the stiffness times the distance from the reference.

    What to do: decide whether torques include springs. The file is correct, so ``dynx doctor --fix`` does not
    change it. dynx reads springs, and its quantities have them with ``joint_dynamics=True``. The doctor
    compares the rigid bodies alone. No call removes the force element, so the effect in a report is what
    remains of the difference without all other causes.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    advice = "Decide whether torques include springs, and configure each engine accordingly."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield springs whose stiffness is not zero."""
        for joint in _parts(case, "joint"):
            for element in joint.walk():
                if element.tag == "spring_stiffness" and float(_text(case, element) or "0"):
                    yield _found(joint, element, f"the joint has a stiffness of {_text(case, element)}")


class EmptyDynamicsOfSdf(EditingRule):
    """DX707 empty-dynamics-of-sdf: A dynamics element of SDF has neither damping nor friction, for which
    PyBullet refuses the file.

    ``<dynamics>`` of an ``<axis>`` may hold a spring alone. Damping and friction are then 0.

    - Drake 1.51 reads it so.
    - PyBullet 3.2.7 (``loadSDF``) refuses the whole file: "joint dynamics element specified with no damping
      and no friction". It does the same for URDF (DX305).

    What to do: write ``<damping>0</damping>``. ``dynx doctor --fix`` does so. Nothing else changes in the
    element.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write <damping>0</damping>."
    engines = measured_on("pybullet")
    changed = "wrote a damping of 0 into <dynamics> without damping and friction"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the dynamics of axes that have neither."""
        for joint in _parts(case, "joint"):
            for axis in joint.all("axis"):
                dynamics = axis.first("dynamics")
                if dynamics is None or dynamics.first("damping") or dynamics.first("friction"):
                    continue
                detection = _found(joint, dynamics, "<dynamics> has neither damping nor friction")
                yield Correction(detection, (case.source.insertion(dynamics, "<damping>0</damping>"),))
