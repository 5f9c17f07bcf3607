"""What importers of SDF leave out or read otherwise than the format says."""

from __future__ import annotations

import os
import posixpath
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import ClassVar
from xml.sax.saxutils import escape, quoteattr

from dynx.errors import ModelError, escaped, shown
from dynx.files.reading import read_file
from dynx.model.document_format import Format
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_above, find_mesh
from dynx.model.package_search import MODEL_MANIFEST
from dynx.model.sdf.document import included_files, scenery_of, version_of
from dynx.model.sdf.vocabulary import is_undefined
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules import CallingRule, Case, Correction, Detection, EditingRule, Remedy, Rule, measured_on
from dynx.rules.geometry import file_of_mesh, is_found
from dynx.rules.inertia import ACCEPTED_MOMENT, LEAST_MASS
from dynx.rules.joints import fresh_name
from dynx.rules.numbers_in_text import decimal


def _parts(case: Case, tag: str) -> Iterator[SourceElement]:
    """Yield the links or joints of all models in the text, in document order; a ``<state>`` has none."""
    for element in case.source.root.walk():
        around = element.parent
        if element.tag == tag and around is not None and around.tag == "model" and not _is_state(around):
            yield element


def _is_state(model: SourceElement) -> bool:
    around: SourceElement | None = model
    while around is not None and around.tag != "state":
        around = around.parent
    return around is not None


def _found(element: SourceElement, at: SourceElement, message: str) -> Detection:
    """Return the detection at a part of a link or joint; one of a nested model has no name here."""
    model = element.parent
    nested = model is not None and model.parent is not None and model.parent.tag == "model"
    name = None if nested else element.attributes.get("name")
    link, joint = (name if element.tag == tag else None for tag in ("link", "joint"))
    return Detection(link, joint, at.line, message)


class InertiaFromShapesOfSdf(CallingRule):
    """DX701 inertia-from-shapes-of-sdf: PyBullet computes moments of inertia from shapes, and ignores the
    moments in the file.

    ``<inertial>`` of SDF has ``<mass>`` and ``<inertia>`` with six entries.

    - Drake 1.51 reads both.
    - PyBullet 3.2.7 (``loadSDF``) reads the mass and the pose of the inertial. It computes the moments from
      the bounding box of the collision shapes. Without shapes the moments are 0. PyBullet has no flag to read
      the moments of the file.

    The effect: every link has another inertia. In most robots the mass matrix is off by tens of per cent.

    What to do: set the moments after loading. Or convert the file to URDF (``dynx convert --to urdf``), and
    load this URDF file with ``URDF_USE_INERTIA_FROM_FILE``. The file is correct, so ``dynx doctor --fix``
    does not change the file. The doctor prints the call that sets the moments. This call cannot set products
    of inertia (DX712).
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Set the moments after loading, or load a URDF (dynx convert --to urdf)."
    engines = measured_on("pybullet")
    calls = ("pybullet.set_inertias",)
    changed = "compared with the masses and moments of the file"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield links that may move, but for a file in which all moments are those of boxes."""
        for link in _parts(case, "link"):
            # A link without an inertial has 1 kg and 1 kg m^2 by the format.
            if not _is_box(case, link) and not _is_static(case, link):
                yield _found(link, link.first("inertial") or link, "the link has moments of its own")


def _is_box(case: Case, link: SourceElement) -> bool:
    """Check whether the moments of a link are those of the one box that is all its shape, or are 0 without
    any shape."""
    collisions = link.all("collision")
    sizes = [each for shape in collisions for each in shape.walk() if each.tag == "size"]
    name = link.attributes.get("name", "")
    names = {each.name for each in case.model.links}
    if name not in names or len(collisions) > 1:
        return False
    inertial = case.model.inertial(name)
    if not collisions:
        return not inertial.tensor.any()
    if len(sizes) != 1:
        return False
    x, y, z = (each * each / 12.0 for each in map(float, case.source.text_in(sizes[0]).split()))
    wanted = [inertial.mass * each for each in (y + z, x + z, x + y)]
    held = [inertial.ixx, inertial.iyy, inertial.izz]
    close = all(abs(one - other) <= 1e-12 * max(held) for one, other in zip(wanted, held, strict=True))
    return close and not any((inertial.ixy, inertial.ixz, inertial.iyz))


def _is_static(case: Case, link: SourceElement) -> bool:
    """Check whether a link is of a model that never moves, whose inertia nothing uses."""
    around = link.parent
    while around is not None:
        static = around.first("static") if around.tag == "model" else None
        if static is not None and _is_true(case, static):
            return True
        around = around.parent
    return False


def _is_true(case: Case, element: SourceElement) -> bool:
    return case.source.text_in(element) in ("1", "true")


class AxisWithoutLimit(EditingRule):
    """DX702 axis-without-limit: An axis of SDF has no limit, so PyBullet refuses the file.

    ``<limit>`` of an ``<axis>`` is optional. Without it a joint is unlimited.

    - Drake 1.51 reads an unlimited joint.
    - PyBullet 3.2.7 (``loadSDF``) refuses the file ("Cannot load SDF file") if the joint is revolute or
      prismatic. It accepts a continuous joint.

    What to do: write a limit. In SDF the limit 1e16 means "no limit". ``dynx doctor --fix`` writes this
    limit.
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
    """DX703 inertial-without-inertia: An inertial of SDF has no inertia, so PyBullet refuses the file.

    An example is ``<inertial><mass>20</mass></inertial>``. In SDF the default of the moments is 1 kg m^2
    about each axis.

    - Drake 1.51 uses this default.
    - PyBullet 3.2.7 (``loadSDF``) refuses the file: "Inertial element must have inertia element".

    The default is rarely right: a link of 20 kg with moments of 1 kg m^2 has a size of about 0.3 m.

    What to do: write the moments of the link. ``dynx doctor --fix`` writes the default.
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

    In SDF a pose may be relative to another frame (``relative_to``, ``<frame>``). Its angles may be in
    degrees, or a quaternion. An axis may be in another frame (``expressed_in``, ``use_parent_model_frame``).
    A joint may have an offset from its child (``<pose>``).

    - Drake 1.51 reads all these poses and axes.
    - PyBullet 3.2.7 (``loadSDF``) reads the pose of a link as six numbers in the frame of the model. It reads
      an axis in the frame of the child. It ignores these attributes, and the pose of a joint. If a pose has
      no numbers, PyBullet ends the process.

    The effect: the link has another pose, or the joint has another axis.

    What to do: convert the file to URDF for PyBullet (``dynx convert --to urdf``). ``dynx doctor --fix`` does
    not change the file. So the report measures the effect as the difference that remains after all other
    causes are removed.
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
                    elif element.tag == "use_parent_model_frame" and case.source.text_in(element) in (
                        "1",
                        "true",
                    ):
                        yield _found(part, element, "the axis is stated in the frame of the model")


class JointToWorld(Rule):
    """DX705 joint-to-world: A joint connects a link to the world, so PyBullet refuses the file.

    ``<parent>world</parent>`` fixes a robot of SDF to the world.

    - Drake 1.51 welds the link to its world.
    - PyBullet 3.2.7 (``loadSDF``) finds no link named ``world``, and refuses the file: "Cannot find parent
      link for a joint".

    What to do: convert the file to URDF for PyBullet (``dynx convert --to urdf``), and load it with
    ``useFixedBase=True``. ``dynx doctor --fix`` does not change the file, because without this joint the
    robot would float.
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
            if parent is not None and case.source.text_in(parent) == "world":
                yield _found(joint, parent, "the parent of the joint is the world")


class SpringOfSdf(Rule):
    """DX706 spring-of-sdf: A joint of SDF has a spring, which Drake adds to the torque.

    ``<spring_stiffness>`` and ``<spring_reference>`` in ``<dynamics>`` of an axis are a spring.

    - Drake 1.51 adds a force element. Forward dynamics, and inverse dynamics with force elements, include it.
    - PyBullet 3.2.7 (``loadSDF``) drops the spring.

    The effect is the stiffness times the distance from the reference.

    What to do: decide whether torques include springs. The file is correct, so ``dynx doctor --fix`` does not
    change the file. dynx reads springs, and its quantities include them with ``joint_dynamics=True``. The
    doctor compares the rigid bodies alone. No call removes the force element from Drake. So the report
    measures the effect as the difference that remains after all other causes are removed.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_numbers = True
    advice = "Decide whether torques include springs, and configure each engine accordingly."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield springs whose stiffness is not zero."""
        for joint in _parts(case, "joint"):
            for element in joint.walk():
                if element.tag == "spring_stiffness" and float(case.source.text_in(element) or "0"):
                    yield _found(
                        joint, element, f"the joint has a stiffness of {case.source.text_in(element)}"
                    )


class EmptyDynamicsOfSdf(EditingRule):
    """DX707 empty-dynamics-of-sdf: A dynamics element of SDF has neither damping nor friction, so PyBullet
    refuses the file.

    In ``<dynamics>`` of an ``<axis>``, ``<damping>`` and ``<friction>`` are optional, with the default 0. For
    example, the element may contain only a spring.

    - Drake 1.51 reads the file.
    - PyBullet 3.2.7 (``loadSDF``) refuses the file: "joint dynamics element specified with no damping and no
      friction". It also refuses such URDF files (DX305).

    What to do: write ``<damping>0</damping>``, as ``dynx doctor --fix`` does.
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


class IncludeOfSdf(Rule):
    """DX708 include-of-sdf: A model of SDF includes another model, which PyBullet ignores.

    ``<include><uri>model://arm</uri></include>`` adds the model of another file.

    - Drake 1.51 reads the file that the URI names (DX711).
    - PyBullet 3.2.7 (``loadSDF``) ignores the element without a message. It refuses a file that has no other
      links: "Cannot load SDF file".

    The robot lacks the links and joints of the other file.

    What to do: write a file with all links (``dynx convert --to urdf`` or ``--to sdf``).
    ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_refusal = True
    advice = "Write a file with all links (dynx convert)."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the includes of models and worlds."""
        for element in case.source.root.walk():
            if element.tag == "include":
                yield Detection(None, None, element.line, f"the file includes {_uri(case, element)}")


def _uri(case: Case, include: SourceElement) -> str:
    uri = include.first("uri")
    return "" if uri is None else case.source.text_in(uri)


class SeveralRootsOfSdf(Rule):
    """DX709 several-roots-of-sdf: Several links of a model have no joint to a parent, and PyBullet crashes.

    A static model of SDF may have links that no joint connects. All links of a static model are fixed to the
    world. In a model that moves, a link may be the child of several joints (DX716).

    - Drake 1.51 fixes each of these links of a static model to its world.
    - PyBullet 3.2.7 (``loadSDF``) prints "URDF file with multiple root links found", and then the process
      ends with a segmentation fault.

    What to do: connect the links by fixed joints. Or convert the file to URDF (``dynx convert --to urdf``),
    which adds such joints. ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    stated = True
    stated_refusal = True
    advice = "Connect the links by fixed joints (dynx convert --to urdf)."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the second root of each model."""
        for model in case.source.root.walk():
            if model.tag != "model":
                continue
            ends = [child for joint in model.all("joint") for child in joint.all("child")]
            children = {case.source.text_in(each) for each in ends}
            roots = [each for each in model.all("link") if each.attributes.get("name") not in children]
            for link in roots[1:2]:
                yield _found(link, link, f"the model has {len(roots)} links that are the child of no joint")


class SharedNameOfSdf(EditingRule):
    """DX710 shared-name-of-sdf: Two parts of one model or link have the same name, so Drake refuses the file.

    Within a model, all links, joints and frames must have different names. Within a link, all collisions must
    have different names, and so must all visuals. Older files violate this: a joint has the name of its link,
    a joint is called ``world``, or two visuals are called ``visual``.

    - Drake 1.51 refuses the file: "Non-unique name", "The supplied joint name [world] is reserved" or "visual
      with name[visual] already exists".
    - PyBullet 3.2.7 (``loadSDF``) loads the file.

    What to do: give the second part another name. ``dynx doctor --fix`` renames joints and shapes. It also
    changes the names in mimic joints. If a program looks up a joint by its name, also change the program. The
    rule does not examine names of frames.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Give each part of a model and of a link a name of its own."
    engines = measured_on("drake")
    changed = "gave parts with the name of another one a name of their own"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield joints with the name of a link, and shapes with that of another, in document order."""
        for model in case.source.root.walk():
            if model.tag != "model":
                continue
            links = {"world", *(each.attributes.get("name") for each in model.all("link"))}
            taken = links | {each.attributes.get("name") for each in model.all("joint")}
            for part in model.children:
                name = part.attributes.get("name", "")
                if part.tag == "link":
                    yield from _shapes_of_one_name(case, part)
                elif part.tag == "joint" and name in links:
                    new = fresh_name(f"{name}_joint", [each for each in taken if each])
                    taken.add(new)
                    whose = "the world" if name == "world" else "a link"
                    detection = _found(part, part, f"the joint has the name of {whose}")
                    yield Correction(detection, _joint_edits(case, model, part, new))


def _joint_edits(case: Case, model: SourceElement, joint: SourceElement, new: str) -> tuple[Edit, ...]:
    """Return the edits that give a joint another name, also where others follow it."""
    old = joint.attributes.get("name")
    followers = [each for each in model.walk() if each.tag == "mimic" and each.attributes.get("joint") == old]
    edits = [case.source.attribute_edit(joint, "name", new)]
    edits += [case.source.attribute_edit(each, "joint", new) for each in followers]
    return tuple(edits)


def _shapes_of_one_name(case: Case, link: SourceElement) -> Iterator[Correction]:
    for tag in ("collision", "visual"):
        taken: set[str] = set()
        for shape in link.all(tag):
            name = shape.attributes.get("name", "")
            if name in taken:
                new = fresh_name(f"{name}_{len(taken) + 1}", taken)
                detection = _found(link, shape, f"another <{tag}> of the link has the name {name}")
                yield Correction(detection, (case.source.attribute_edit(shape, "name", new),))
                name = new
            taken.add(name)


class ModelsInOtherFolders(CallingRule):
    """DX711 models-in-other-folders: The file includes a model by its name or by the path of a file, which
    Drake does not search for.

    ``model://arm`` and ``arm`` mean a folder ``arm``, or a folder whose ``model.config`` has this name.
    Gazebo searches for the folder in ``GZ_SIM_RESOURCE_PATH``. dynx searches near the file and in
    ``package_dirs``. ``arm/model.sdf`` and ``arm.sdf`` mean a file in the folder of the file that has the
    include.

    - Drake 1.51 searches only in the ``package_map`` of its parser. If the folder is not there, it refuses
      the file ("Unable to find uri"). Otherwise it reads ``model://arm/`` and ``model://arm/model.sdf``, but
      not ``model://arm``, ``arm``, ``arm/model.sdf`` and ``arm.sdf``.
    - PyBullet 3.2.7 (``loadSDF``) ignores ``<include>`` (DX708).

    Most worlds include ``model://sun`` and ``model://ground_plane``, which Gazebo brings along. dynx reads
    the file without them where they are not found.

    What to do: write the URI as ``model://arm/`` or ``model://arm/model.sdf``, as ``dynx doctor --fix`` does.
    It removes the sun and the ground where they are not found. Add each folder to the package map before
    Drake reads the file; the doctor prints this call.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write the URI as model://FOLDER/, and add the folder to the package map of Drake's parser."
    engines = measured_on("drake")
    calls = ("drake.add_models",)
    changed = "added the folders of models to the package map, and wrote their URIs as model://FOLDER/"
    per_joint = False

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield includes by the name of a model or by a path."""
        for element in case.source.root.walk():
            uri = _uri(case, element)
            if element.tag == "include" and (uri.startswith("model://") or scenery_of(uri) or _is_path(uri)):
                yield Detection(None, None, element.line, f"the file includes {uri}")

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the call, and with the URIs that Drake reads."""
        every = [each for each in case.source.root.walk() if each.tag == "include"]
        absent = [each for each in every if _is_absent_scenery(case, _uri(case, each))]
        includes = [each for each in every if each not in absent]
        uris = [uri for each in includes if (uri := each.first("uri")) is not None]
        new = [_uri_for_drake(case, case.source.text_in(uri)) for uri in uris]
        edits = [
            case.source.replacement(uri, f"<uri>{escape(text)}</uri>")
            for uri, text in zip(uris, new, strict=True)
            if text != case.source.text_in(uri)
        ] + [case.source.removal(each) for each in absent]
        called = case.with_source(case.source.apply(*edits)).with_calls(*self.calls)
        removed = "removed the sun and the ground of Gazebo, which were not found"
        parts = [self.changed] * bool(len(every) - len(absent)) + [removed] * bool(absent)
        return Remedy(called, " and ".join(parts))


def _is_absent_scenery(case: Case, uri: str) -> bool:
    """Check whether a URI names the sun or the ground of Gazebo, and no file around the text is that."""
    try:
        manifest = f"{uri.rstrip('/')}/{MODEL_MANIFEST}"
        return scenery_of(uri) is not None and find_mesh(manifest, case.source.source) is None
    except MeshNotFoundError:
        return True


_MODEL = re.compile("model://[^/]+")
"""URI of a model without a path in its folder."""

_SDF_FILES = (".sdf", ".world", ".xml")


def _is_path(uri: str) -> bool:
    """Check whether a URI is the bare name of a model, or a path that is not absolute."""
    return bool(uri) and "://" not in uri and not uri.startswith("/")


def _is_unread_by_drake(uri: str) -> bool:
    """Check whether Drake does not read a URI, whatever the package map has."""
    return bool(_MODEL.fullmatch(uri)) or _is_path(uri)


def _uri_for_drake(case: Case, uri: str) -> str:
    """Return the URI of the same model that Drake reads with the folders of models in its package map."""
    if _MODEL.fullmatch(uri):
        return f"{uri}/"
    if not _is_path(uri):
        return uri
    parts = posixpath.normpath(uri).split("/")
    above = parts.count("..")
    inside = "/".join(parts[above:])
    if "/" in inside:
        return f"model://{inside}"
    if not inside.lower().endswith(_SDF_FILES):
        return f"model://{inside}/"
    # A file that lies in no folder of its own: in the folder of the document, or in one above it.
    folders = Path(os.path.realpath(case.source.source)).parents
    return f"model://{folders[above].name}/{inside}" if above < len(folders) else uri


class FaultsOfIncludedFiles(Rule):
    """DX720 faults-of-included-files: A file that the file includes has a part that Drake refuses.

    Models of drones consist of files that include one another. For example ``x500_depth`` includes ``x500``,
    and ``x500`` includes ``x500_base``.

    - Drake 1.51 refuses the file ("Unable to find uri") if an included file names a model as
      ``model://arm``, ``arm``, ``arm/model.sdf`` or ``arm.sdf``, whatever the package map of its parser has
      (DX711). Drake also refuses the file if an included file has an element that SDF does not define
      (DX721). If the ``model.config`` of an included model has ``<sdf>`` without ``version``, Drake refuses
      the file or crashes.
    - PyBullet 3.2.7 (``loadSDF``) ignores ``<include>`` (DX708).

    What to do: write one file with all links (``dynx convert --to sdf``). Or examine each included file by
    ``dynx doctor``. ``dynx doctor --fix`` does not change included files.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_refusal = True
    advice = "Write one file with all links (dynx convert --to sdf)."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the parts of included files that Drake does not read."""
        if not any(each.tag == "include" for each in case.source.root.walk()):
            return
        with suppress(ModelError):
            text, source = case.source.text_with_lines_before, case.source.source
            for path, line in included_files(text, source).items():
                included = XmlSource(read_file(path), path)
                file = "/".join(Path(path).parts[-2:])
                for inner, fault in _faults_in(included):
                    found = f"in the included file {file}, line {inner}, {fault}"
                    yield Detection(None, None, line, found)
                for entry in _entries_without_version(Path(path).with_name(MODEL_MANIFEST)):
                    found = (
                        f"in {Path(path).parent.name}/{MODEL_MANIFEST}, line {entry}, <sdf> has no version"
                    )
                    yield Detection(None, None, line, found)


def _entries_without_version(manifest: Path) -> list[int]:
    """Return the lines of a manifest, if there is one, that name a file of no version of SDF."""
    if not manifest.is_file():
        return []
    entries = XmlSource(read_file(str(manifest)), str(manifest)).root.all("sdf")
    return [each.line for each in entries if not each.attributes.get("version", "").strip()]


def _faults_in(source: XmlSource) -> Iterator[tuple[int, str]]:
    """Yield the line and the description of each part of a file that Drake does not read."""
    for element in source.root.walk():
        uri = element.first("uri") if element.tag == "include" else None
        if uri is not None and _is_unread_by_drake(source.text_in(uri)):
            yield element.line, f"the file includes {source.text_in(uri)}"
    for element in _undefined_elements(source):
        yield element.line, _described(element)


class ProductsOfInertiaOfSdf(Rule):
    """DX712 products-of-inertia-of-sdf: A tensor of SDF has products of inertia, which PyBullet cannot hold.

    ``<ixy>``, ``<ixz>`` and ``<iyz>`` are the products of inertia in the frame of the inertial.

    - Drake 1.51 reads them.
    - PyBullet 3.2.7 (``loadSDF``) does not read the tensor (DX701). ``changeDynamics`` sets three moments,
      about the axes of the inertial. The products of inertia are lost.

    The effect is as large as the products of inertia, relative to the moments.

    What to do: rotate the frame of the inertial into the principal axes (``<pose>`` of ``<inertial>``). Or
    write a URDF file by ``dynx convert --to urdf``; PyBullet reads its tensors. ``dynx doctor --fix`` does
    not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_numbers = True
    advice = "Rotate the frame of the inertial into the principal axes, or convert the file to URDF."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield links whose tensor has a product that is not zero."""
        for link in _parts(case, "link"):
            for element in link.walk():
                if element.tag in ("ixy", "ixz", "iyz") and float(case.source.text_in(element) or "0"):
                    yield _found(link, element, f"<{element.tag}> is {case.source.text_in(element)}")
                    break


class JointOfTwoAxesOfSdf(EditingRule):
    """DX713 joint-of-two-axes-of-sdf: A joint of SDF has two axes, which engines refuse or keep as one joint.

    ``universal`` and ``revolute2`` joints have ``<axis>`` and ``<axis2>``. dynx reads them as two revolute
    joints, ``NAME_axis`` and ``NAME_axis2``, with a link without mass between them.

    - Drake 1.51 reads a universal joint as one joint with two coordinates, so it has no joints with these
      names and cannot be compared. It refuses ``revolute2``: "Joint type (revolute2) not supported".
    - PyBullet 3.2.7 (``loadSDF``) refuses the file: "Joint hip has unknown type: universal".

    What to do: write two revolute joints with a link without mass between them, as ``dynx doctor --fix``
    does. Both joints have the pose of the joint. If a program looks up the joint by its name, also change
    the program. The rule leaves a joint as it is if its child is in a nested model.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write two revolute joints, with a link without mass between them."
    engines = measured_on("pybullet", "drake")
    changed = "wrote two revolute joints in place of each joint of two axes"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield universal and revolute2 joints with both axes, in document order."""
        names = {each.name for each in case.model.joints}
        for joint in _parts(case, "joint"):
            kind = joint.attributes.get("type")
            if kind in ("universal", "revolute2") and joint.first("axis") and joint.first("axis2"):
                first = f"{joint.attributes.get('name')}_axis"
                message = f"the joint is {kind} and has two axes"
                detection = Detection(None, first if first in names else None, joint.line, message)
                yield Correction(detection, tuple(_two_joints(case, joint)))


_MASSLESS = """<inertial>
    <mass>0</mass>
    <inertia><ixx>0</ixx><ixy>0</ixy><ixz>0</ixz><iyy>0</iyy><iyz>0</iyz><izz>0</izz></inertia>
  </inertial>"""


def _two_joints(case: Case, joint: SourceElement) -> Iterator[Edit]:
    """Yield the edits that write a joint of two axes as two joints; none if its child is not in its model."""
    source, model, name = case.source, joint.parent, joint.attributes.get("name", "")
    child, second = joint.first("child"), joint.first("axis2")
    if model is None or child is None or second is None:
        return
    carried = source.text_in(child)
    links = [each for each in model.all("link") if each.attributes.get("name") == carried]
    if len(links) != 1:
        return
    taken = {each.attributes.get("name", "") for each in model.children} - {name}
    names = [fresh_name(f"{name}_{tag}", taken) for tag in ("axis", "axis2")]
    between = fresh_name(f"{names[0]}_link", taken)
    # The frame of a joint is attached to its child, so whatever is placed in it follows the second joint.
    for element in model.walk():
        if element.tag == "mimic":
            follows = element.attributes.get("joint") == name
            wanted = names[element.attributes.get("axis") == "axis2"]
            if follows:
                yield source.attribute_edit(element, "joint", wanted)
            continue
        for key in ("relative_to", "attached_to", "expressed_in"):
            if element.attributes.get(key) == name and not _is_inside(element, second):
                yield source.attribute_edit(element, key, names[1])
    yield source.attribute_edit(joint, "name", names[0])
    yield source.attribute_edit(joint, "type", "revolute")
    yield source.replacement(child, f"<child>{escape(between)}</child>")
    yield source.removal(second)
    pose = links[0].first("pose")
    placed = "" if pose is None else _renamed(_text_of(source, pose), name, names[0])
    own = joint.first("pose")
    parts = [
        f"<parent>{escape(between)}</parent>",
        f"<child>{escape(carried)}</child>",
        *([] if own is None else [_text_of(source, own)]),
        _renamed(re.sub(r"\baxis2(?=\s*[>/])", "axis", _text_of(source, second)), name, names[1]),
    ]
    lines = [f"<link name={quoteattr(between)}>", *([f"  {placed}"] if placed else []), f"  {_MASSLESS}"]
    lines += ["</link>", f'<joint name={quoteattr(names[1])} type="revolute">']
    lines += ["  " + each.replace("\n", "\n  ") for each in parts]
    lines.append("</joint>")
    yield source.insertion_after(joint, "\n".join(lines))


def _is_inside(element: SourceElement, around: SourceElement) -> bool:
    return around.span.start <= element.span.start and element.span.end <= around.span.end


def _text_of(source: XmlSource, element: SourceElement) -> str:
    """Return an element as it is written, with two blanks for each level of indentation below it."""
    first, *rest = element.data[element.span.start : element.span.end].decode().splitlines()
    bare = [line.lstrip() for line in rest]
    levels = [(line[: len(line) - len(own)]).count(source.unit) for line, own in zip(rest, bare, strict=True)]
    outer = source.indent_of(element).count(source.unit)
    inner = (f"{'  ' * max(each - outer, 0)}{own}" for each, own in zip(levels, bare, strict=True))
    return "\n".join([first, *inner])


def _renamed(text: str, name: str, new: str) -> str:
    """Return the text of an element in which poses and axes are stated in a frame with another name."""
    stated = rf"""\b(relative_to|expressed_in)\s*=\s*(["'])({re.escape(escape(name))})\2"""
    return re.sub(stated, lambda found: f"{found[1]}={quoteattr(new)}", text)


class ScriptWithoutUriOfSdf(EditingRule):
    """DX714 script-without-uri-of-sdf: A material of SDF has a script without a URI, so Drake refuses the
    file.

    ``<script><name>Gazebo/Red</name></script>`` names a material of Gazebo. The format requires a ``<uri>``
    in it, which names the file of the material. ``__default__`` counts as no URI.

    - Drake 1.51 refuses the file: "A <script> element is missing a child <uri> element".
    - PyBullet 3.2.7 (``loadSDF``) loads the file.

    What to do: write the URI, which is ``file://media/materials/scripts/gazebo.material`` for the materials
    of Gazebo. ``dynx doctor --fix`` writes it. Only the colour of a visual depends on the script.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Write the <uri> of the script."
    engines = measured_on("drake")
    changed = "wrote the URI of Gazebo's materials into scripts without a URI"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield scripts of materials without a URI, in document order."""
        uri = "<uri>file://media/materials/scripts/gazebo.material</uri>"
        for link in _parts(case, "link"):
            for script in (each for each in link.walk() if each.tag == "script"):
                if script.parent is None or script.parent.tag != "material":
                    continue
                named = script.first("uri")
                if named is None:
                    edit = case.source.insertion(script, uri)
                elif case.source.text_in(named) not in ("", "__default__"):
                    continue
                else:
                    edit = case.source.replacement(named, uri)
                yield Correction(_found(link, script, "the script has no URI"), (edit,))


class NestedModelOfSdf(Rule):
    """DX715 nested-model-of-sdf: A model of SDF contains another model, which PyBullet ignores.

    ``<model>`` within ``<model>`` has links and joints of its own, named ``MODEL::LINK`` outside it.

    - Drake 1.51 reads the nested model.
    - PyBullet 3.2.7 (``loadSDF``) ignores the nested model without a message. If a joint outside it has one
      of its links as parent or child, PyBullet refuses the file: "Cannot find child link for a joint".

    The robot lacks the links and joints of the nested model.

    What to do: write a file without nested models (``dynx convert --to urdf``). ``dynx doctor --fix`` does
    not change the file, because links would have other names.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_refusal = True
    advice = "Write a file without nested models (dynx convert --to urdf)."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the models within models."""
        for element in case.source.root.walk():
            around = element.parent
            nested = element.tag == "model" and around is not None and around.tag == "model"
            if nested and not _is_state(element):
                name = shown(element.attributes.get("name", ""))
                yield Detection(None, None, element.line, f"the model contains the model {name}")


class OtherFloatingLinkOfSdf(Rule):
    """DX716 other-floating-link-of-sdf: Several links are the child of no joint, and Drake lets another of
    them float than dynx.

    A link may be the child of several joints. For example, ``left_finger`` and ``right_finger`` are both
    parents of ``palm``. Such a model is a tree, in which some joints lead from the child to the parent.

    - Drake 1.51 reads these joints backwards, as dynx does. One of the links without a parent floats. It need
      not be the first of them, which is the root in dynx. Then the coordinates of the base are those of
      another link, and the doctor does not use Drake.
    - PyBullet 3.2.7 (``loadSDF``) crashes (DX709).

    What to do: exchange parent and child of the joints that lead to the link, and negate their axes. Or write
    such a file by ``dynx convert --to sdf``. ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    advice = "Write joints that lead away from one link (dynx convert --to sdf)."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the second root of each model that floats."""
        for model in case.source.root.walk():
            static = model.first("static")
            if model.tag != "model" or _is_state(model) or (static is not None and _is_true(case, static)):
                continue
            ends = {
                tag: {case.source.text_in(each) for joint in model.all("joint") for each in joint.all(tag)}
                for tag in ("parent", "child")
            }
            roots = [
                each
                for each in model.all("link")
                if each.attributes.get("name") in ends["parent"] - ends["child"]
            ]
            for link in () if "world" in ends["parent"] else roots[1:2]:
                yield _found(link, link, f"the model has {len(roots)} links that are only parents of joints")


class PartsOfStateOfSdf(EditingRule):
    """DX717 parts-of-state-of-sdf: The state of a world has models or lights, so Drake refuses the file.

    Gazebo saves a world with ``<state>``, which has the pose and the velocity of each model at that time.

    - Drake 1.51 refuses the file: "XML Element[model], child of element[state], not defined in SDF".
    - PyBullet 3.2.7 (``loadSDF``) and dynx ignore the element. Each model has the pose that it states itself.

    What to do: remove the models and lights from ``<state>``, as ``dynx doctor --fix`` does. Gazebo then
    starts at the poses of the models.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Remove models and lights from <state>."
    engines = measured_on("drake")
    changed = "removed models and lights from the state of the world, so that Gazebo starts at their poses"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the models and lights of states, in document order."""
        for element in case.source.root.walk():
            around = element.parent
            if element.tag in ("model", "light") and around is not None and around.tag == "state":
                name = shown(element.attributes.get("name", ""))
                message = f"the state has the {element.tag} {name}"
                place = Detection(None, None, element.line, message)
                yield Correction(place, (case.source.removal(element),))


class MeshInOtherFolder(Rule):
    """DX718 mesh-in-other-folder: PyBullet does not find the mesh of a collision, and refuses the file.

    ``model://arm/arm.stl`` is the file ``arm.stl`` of the model ``arm``. Gazebo searches for the model in
    ``GZ_SIM_RESOURCE_PATH``. dynx also searches in ``package_dirs`` and near the file: for a folder with this
    name, and for a folder whose ``model.config`` has this name.

    - PyBullet 3.2.7 (``loadSDF``) ignores ``model://``. It searches for ``arm/arm.stl`` in the folder of the
      file and in the folders above it. If the mesh is not there, PyBullet refuses the file: "Could not parse
      collision element".
    - Drake 1.51 reads the dynamics without the mesh.

    A mesh that only draws does not matter.

    What to do: start PyBullet in a folder that contains the folder of the model. Or convert the file to URDF
    (``dynx convert --to urdf``). ``dynx doctor --fix`` does not change the file.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_refusal = True
    advice = "Start PyBullet in a folder that contains the folder of the model, or convert the file to URDF."
    engines = measured_on("pybullet")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the meshes of collisions that dynx finds and PyBullet does not."""
        for link in _parts(case, "link"):
            for shape in link.all("collision"):
                for mesh in (each for each in shape.walk() if each.tag == "mesh"):
                    file, source = file_of_mesh(case.source, mesh), case.source.source
                    if is_found(file, source) and find_above(file, source) is None:
                        yield _found(link, mesh, f"PyBullet does not find {shown(file, 200)}")


class UndefinedElementOfSdf(EditingRule):
    """DX721 undefined-element-of-sdf: The file has an element that SDF does not define, which Drake refuses.

    Examples are ``<gz_frame_id>`` in a sensor, which Gazebo reads, and ``<material>`` in a collision. A name
    with a prefix, such as ``gz:frame``, is allowed, and so is everything in a ``<plugin>``.

    - Drake 1.51 refuses the file ("not defined in SDF").
    - Gazebo prints a warning. PyBullet 3.2.7 (``loadSDF``) ignores the element without a message.

    dynx refuses such an element where it describes the robot, because it may be misspelt. Elsewhere, as in
    sensors and surfaces, dynx ignores it as it ignores the elements around it.

    What to do: remove the element, as ``dynx doctor --fix`` does. If another program reads it, keep it in a
    file of its own for that program.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Remove the element."
    engines = measured_on("drake")
    changed = "removed elements that SDF does not define"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the outermost elements that SDF does not define, in document order."""
        for element in _undefined_elements(case.source):
            part = element.parent
            while part is not None and part.tag not in ("link", "joint"):
                part = part.parent
            message = _described(element)
            found = Detection(None, None, element.line, message)
            yield Correction(
                found if part is None else _found(part, element, message), (case.source.removal(element),)
            )


def _undefined_elements(source: XmlSource) -> Iterator[SourceElement]:
    """Yield the outermost elements that SDF does not define, in document order."""
    version = version_of(source.root.attributes.get("version", ""))
    waiting = [source.root]
    while waiting:
        element = waiting.pop()
        if element.parent is not None and is_undefined(element.parent.tag, element.tag, version):
            yield element
        elif element.tag != "plugin":
            waiting += reversed(element.children)


def _described(undefined: SourceElement) -> str:
    around = "sdf" if undefined.parent is None else undefined.parent.tag
    return f"SDF has no <{escaped(undefined.tag)}> in <{around}>"


class MasslessLinkOfSdf(EditingRule):
    """DX722 massless-link-of-sdf: A link of SDF has mass 0, which engines take for a fixed link or for 1 kg.

    SDF wants a mass above 0. A mass of 0 mostly marks a base that does not move, as in
    ``kuka_iiwa/model.sdf`` of ``pybullet_data``. dynx uses the numbers of the file: the base moves freely.

    - PyBullet 3.2.7 (``loadSDF``) fixes a robot to the world if its root link has mass 0.
    - Drake 1.51 gives a link of mass 0 with moments of inertia a mass of 1 kg, with a warning ("condition
      'mass > 0' failed").

    What to do: if the base does not move, connect it to the world by a fixed joint, or write
    ``<static>true</static>`` into a model without joints that move. Otherwise enter the mass.
    ``dynx doctor --fix`` writes a mass of 2e-15 kg, which engines accept, and which is too small to show in
    any result. ``--choose DX722=keep`` leaves the file unchanged.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    advice = "Connect a base that does not move to the world by a fixed joint, or enter the mass."
    choices: ClassVar[Mapping[str, str]] = {
        "least": "give the link the least mass that engines accept",
        "keep": "keep the file; engines fix a root without mass, or give moments a mass of 1 kg",
    }
    engines = measured_on("drake", "pybullet")
    changed = f"gave links without mass {decimal(LEAST_MASS)} kg"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the masses that are 0 of the root and of links with moments, in document order."""
        bodies = {link.name: link.inertial for link in case.model.links}
        for link in _parts(case, "link"):
            inertial = link.first("inertial")
            mass = None if inertial is None else inertial.first("mass")
            name = link.attributes.get("name", "")
            body = bodies.get(name)
            if inertial is None or mass is None or body is None or body.mass != 0.0:
                continue
            is_root = name == case.model.root and case.base == "floating"
            if not (is_root or body.tensor.any()):
                continue
            edits = [case.source.replacement(mass, f"<mass>{decimal(LEAST_MASS)}</mass>")]
            inertia = inertial.first("inertia")
            if inertia is not None and not body.tensor.any():
                edits.append(case.source.replacement(inertia, _LEAST_INERTIA))
            effect = "the root has no mass" if is_root else "the link has moments of inertia and no mass"
            yield Correction(_found(link, mass, effect), tuple(edits))


_LEAST_INERTIA = "".join(
    ["<inertia>", *(f"<i{axis * 2}>{decimal(ACCEPTED_MOMENT)}</i{axis * 2}>" for axis in "xyz"), "</inertia>"]
)
