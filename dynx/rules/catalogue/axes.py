"""Axes of joints: length, direction and spelling."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np

from dynx.errors import escaped, shown
from dynx.model.document_format import Format
from dynx.model.sdf.reader import axes_in_joint_frames
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.rules import (
    EVERY_ENGINE,
    Case,
    Correction,
    Detection,
    EditingRule,
    Rule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import vector_of
from dynx.rules.joints import (
    SINGLE,
    axis_edit,
    elements_in_joints,
    misspelled_axes,
    misspelled_direction,
    mujoco_reads,
)
from dynx.rules.mjcf import bodies_in_text, mjcf_text, with_defaults
from dynx.rules.numbers_in_text import decimal, is_number

_ROUNDING_OF_LENGTH = 1e-15
"""Distance from 1 of the length of a rounded unit vector; dynx does not change such an axis."""


class AxisNotUnit(EditingRule):
    """DX201 axis-not-unit: The axis of a joint is not a unit vector.

    URDF says that ``<axis xyz="..."/>`` should have length 1. A wrong length does not change the direction,
    and most readers normalise the axis. Examples are ``0 0 -2``, ``1 1 0``, and
    ``0.577350 0.577350 0.577350``. The last axis was rounded to six digits, so its length is off by 1e-6.

    - PyBullet 3.2.7 keeps the length. A prismatic joint then moves by length times its coordinate, so the
      positions of all links beyond it are wrong. The simulation (``stepSimulation``) uses the axis with this
      length for every type of joint, so accelerations are also wrong. But ``calculateInverseDynamics``,
      ``calculateMassMatrix`` and ``calculateJacobian`` scale the axis to length 1, with a warning on stdout.
    - Pinocchio 4.1, MuJoCo 4.0, Drake 1.51 and dynx scale the axis to length 1.
    - MuJoCo and Drake read an axis shorter than about 1e-6 as zero, and refuse the file.

    The effect is the deviation of the length from 1: 1e-7 for a rounded axis, 1 for an axis of length 2.

    What to do: write unit axes with 17 digits. ``dynx doctor --fix`` writes the axis that dynx uses.
    """

    advice = "Scale the axis to length 1 and write 17 digits."
    engines = measured_on("pybullet", "mujoco", "drake")
    changed = "scaled the axes of joints to length 1"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the axes of revolute, continuous and prismatic joints."""
        for joint, axis in elements_in_joints(case, "axis", SINGLE):
            written = vector_of(axis, "xyz")
            if written is None:
                continue
            largest = max(map(abs, written))
            length = largest * float(np.linalg.norm(np.array(written) / largest))
            if abs(length - 1.0) > _ROUNDING_OF_LENGTH:
                message = f"the axis {axis.attributes['xyz']} has length {length:.9g}"
                unit = case.model.joint(joint.attributes["name"]).axis
                edit = case.source.attribute_edit(axis, "xyz", " ".join(map(decimal, unit)))
                yield correction(axis, message, edit)


_COORDINATES = frozenset("xyz")


class AxisWithoutDirection(EditingRule):
    """DX202 axis-without-direction: The axis of a joint that moves is zero or empty.

    ``<axis xyz="0 0 0"/>`` and ``<axis/>`` define no direction of motion. Exporters write the first form for
    fixed joints, whose axes most readers ignore. If someone changes the type to ``revolute``, the axis
    matters. A joint without any ``<axis>`` is fine: all engines use URDF's default (1, 0, 0). If another
    attribute than ``xyz`` has the direction, see DX218.

    - Pinocchio 4.1 loads the file. The joint has a coordinate that moves nothing: its row and column of the
      mass matrix are zero, and forward dynamics gives NaN.
    - PyBullet 3.2.7 loads the file. With the zero axis, positions beyond the joint are NaN, and inverse
      dynamics and mass matrix fail. For ``<axis/>`` PyBullet reads uninitialised memory, so the axis is
      random. The doctor then does not use PyBullet, and reports say "not used".
    - MuJoCo 4.0 refuses the file.
    - Drake 1.51 refuses the zero axis, and reads ``<axis/>`` as (1, 0, 0).

    What to do: write the direction. For ``<axis x="0" y="0" z="1"/>``, ``dynx doctor --fix`` writes
    ``xyz="0 0 1"``. In other cases the file does not contain the direction, and ``dynx doctor --fix`` writes
    URDF's default, (1, 0, 0). If the joint should not move, ``--choose DX202=fixed`` makes it a fixed joint.
    """

    stage = "reading"
    advice = "Write the direction of the axis, or make the joint fixed."
    engines = EVERY_ENGINE
    choices = {
        "x": "write URDF's default (1, 0, 0) for an axis without direction",
        "fixed": "make the joint fixed if its axis has no direction",
    }
    changed = "gave joints without a direction to move in one, or fixed them"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of revolute, continuous and prismatic joints."""
        for joint, axis in elements_in_joints(case, "axis", SINGLE):
            if misspelled_direction(axis) is not None:
                continue
            words = axis.attributes.get("xyz", "").split()
            if any(not is_number(word) or float(word) != 0.0 for word in words):
                continue
            what = "is zero" if words else "has no numbers"
            message = f"the axis of a {joint.attributes['type']} joint {what}"
            written = _direction_in_parts(axis)
            if written is not None:
                removals = (
                    case.source.attribute_removal(axis, name)
                    for name in _COORDINATES & axis.attributes.keys()
                )
                edits = (*removals, case.source.attribute_edit(axis, "xyz", written))
                place = found_at(axis, f"{message}; xyz is {written} in attributes of their own")
                yield Correction(place, edits, ("xyz",), whole=True)
                continue
            if self.chosen(case) == "fixed":
                edit = case.source.attribute_edit(joint, "type", "fixed")
            else:
                edit = case.source.attribute_edit(axis, "xyz", "1 0 0")
            yield correction(axis, message, edit)


def _direction_in_parts(axis: SourceElement) -> str | None:
    """Return the direction of an axis without ``xyz`` whose x, y and z are attributes of their own."""
    words = [axis.attributes.get(name, "0").strip() for name in sorted(_COORDINATES)]
    if "xyz" in axis.attributes or not all(map(is_number, words)) or not any(map(float, words)):
        return None
    return " ".join(words)


class AxisAttributeMisspelled(EditingRule):
    """DX218 axis-attribute-misspelled: The direction of an axis is in another attribute than ``xyz``.

    Examples are ``<axis xzy="0 0 1"/>``, ``<axis XYZ="0 0 1"/>`` and ``<axis rpy="0 0 1"/>``. No engine reads
    the numbers under such a name.

    - Pinocchio 4.1 loads the file with a zero axis. The joint has a coordinate that moves nothing: its row
      and column of the mass matrix are zero.
    - PyBullet 3.2.7 loads the file, but reads the axis from uninitialised memory, so the axis is random. The
      doctor then does not use PyBullet, and reports say "not used".
    - MuJoCo 4.0 refuses the file ("required attribute missing: 'xyz'"), even if the joint is fixed.
    - Drake 1.51 reads (1, 0, 0), URDF's default for a joint without ``<axis>``.

    Of the four engines, only MuJoCo reads the axis of a fixed joint. dynx refuses such an axis of a joint
    that moves, and names the attribute.

    What to do: correct the name. ``dynx doctor --fix`` corrects it if the attribute holds three numbers that
    are not all zero. For an axis without any numbers, see DX202 (DX219 if the joint is fixed).
    """

    stage = "reading"
    advice = "Write the direction as xyz."
    engines = EVERY_ENGINE
    changed = "named the attribute of axes xyz"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of joints of every type."""
        for _, axis, written in misspelled_axes(case):
            text = axis.attributes[written]
            edits = (
                case.source.attribute_removal(axis, written),
                case.source.attribute_edit(axis, "xyz", text),
            )
            message = f"<axis> has its direction {text} in {escaped(written)} instead of xyz"
            yield correction(axis, message, *edits)


class UnreadableAxisOfFixedJoint(EditingRule):
    """DX219 unreadable-axis-of-fixed-joint: The axis of a fixed or floating joint is not three numbers.

    A fixed or floating joint has no axis. But exporters write ``<axis/>``, ``<axis xyz=""/>`` or the remains
    of a template.

    - MuJoCo 4.0 reads the axis of every joint and refuses the file ("required attribute missing: 'xyz'", "bad
      format in attribute 'xyz'").
    - Pinocchio 4.1, PyBullet 3.2.7, Drake 1.51 and dynx ignore the axis.

    For a direction under another name, such as ``<axis xzy="0 0 1"/>``, see DX218.

    What to do: remove the ``<axis>``, as ``dynx doctor --fix`` does.
    """

    stage = "reading"
    advice = "Remove the <axis> of the joint."
    engines = measured_on("mujoco")
    changed = "removed unreadable axes of joints that have none"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield axes of fixed and floating joints that MuJoCo cannot read."""
        for joint, axis in elements_in_joints(case, "axis", ("fixed", "floating")):
            if mujoco_reads(axis) or misspelled_direction(axis) is not None:
                continue
            text = axis.attributes.get("xyz")
            what = "no xyz" if text is None else f"xyz={shown(text)}"
            message = f"the <axis> of a {joint.attributes['type']} joint has {what}"
            yield correction(axis, message, case.source.removal(axis))


AXES = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}

DRAKE_DEVIATION = 1.825e-8
"""Deviation [rad] from a coordinate axis below which Drake takes that axis."""

PINOCCHIO_DEVIATION = 1e-12
"""Deviation [rad] from a coordinate axis up to which Pinocchio takes that axis."""

_NEGLIGIBLE_DEVIATION = 1e-14
"""Deviation [rad] that is not reported: rounding of a unit vector, with no effect."""


class AxisNearlyAligned(EditingRule):
    """DX226 axis-nearly-aligned: A joint axis differs from a coordinate axis by less than 2e-8 rad; some
    engines drop this.

    CAD programs export axes with noise, such as ``0 1 1.2e-12`` or ``1.6e-10 0 1``. Some engines have faster
    code for axes along x, y and z. They use it if an axis is almost a coordinate axis, within a tolerance.

    - Drake 1.51.1 uses the coordinate axis if a component of the unit axis rounds to more than 1 - 2.2e-16.
      The deviation is then below about 1.8e-8 rad. This applies to revolute, continuous and prismatic joints,
      also from MJCF and SDF.
    - Pinocchio 4.1.0 uses the coordinate axis up to a deviation of 1e-12.
    - Both engines do this only for positive directions. For example, they keep the axis ``1.6e-10 0 -1``.
    - PyBullet 3.2.7, MuJoCo 4.0.0 and dynx use all numbers.

    The effect: poses and torques are off by up to twice the deviation [rad] at every such joint.

    What to do: write the coordinate axis, which the author intended. ``dynx doctor --fix`` writes it, and the
    report says that the physics changed by less than 2e-8. ``--choose DX226=keep`` leaves the axis.
    """

    formats: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf", "sdf")
    engines = measured_on("pinocchio", "drake")
    advice = "Write the coordinate axis."
    choices = {
        "align": "write the coordinate axis; this changes the physics by less than 2e-8",
        "keep": "leave such axes as they are",
    }
    changed = "wrote the coordinate axis for joint axes that were off it by less than 2e-8 rad"
    changes_physics = True

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the axes of joints that turn about one axis or slide."""
        for place, axis, aligned in _axes(case):
            name, deviation = nearest_axis(axis)
            if not _is_rounded(deviation):
                continue
            message = f"the axis is {deviation:.2g} rad off {name}"
            engines = ["Drake"] if deviation > PINOCCHIO_DEVIATION else ["Pinocchio", "Drake"]
            clauses = tuple((engine.lower(), f"exactly {name} in {engine}") for engine in engines)
            found = replace(place, message=message, engine_clauses=clauses)
            yield Correction(found, (aligned(AXES[name]),))


class TurnedAxisNearlyAligned(Rule):
    """DX719 turned-axis-nearly-aligned: In the frame of its joint, an axis of SDF differs from a coordinate
    axis by less than 2e-8 rad; Drake drops this.

    An axis may be stated in another frame than that of the joint: by ``expressed_in`` or
    ``use_parent_model_frame``, and in files before version 1.5 always in the frame of the model. Rounding of
    the ``<pose>`` of the joint then turns the axis. For example, the axis ``0 0 1`` of the model is 3e-10 rad
    off z in the frame of the joint.

    - Drake 1.51.1 uses the coordinate axis, as for an axis with such numbers in the text (DX226).
    - PyBullet 3.2.7 (``loadSDF``) does not read these frames (DX704).

    The effect: poses and torques are off by up to twice the deviation [rad] at every such joint.

    What to do: write the axis in the frame of the joint. ``dynx doctor --fix`` does not change the file. So
    the report measures the effect as the difference that remains after all other causes are removed.
    """

    formats: ClassVar[tuple[Format, ...]] = ("sdf",)
    trap_base = "floating"
    stated = True
    stated_bound = 1e-6
    advice = "Write the axis in the frame of the joint."
    engines = measured_on("drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield joints whose axis is near a coordinate axis, unlike the numbers in the text."""
        written = {place.joint for place, axis, _ in _axes(case) if _is_rounded(nearest_axis(axis)[1])}
        names = {joint.name for joint in case.model.joints}
        for joint, line, axis in axes_in_joint_frames(case.source.text_with_lines_before, case.source.source):
            name, deviation = nearest_axis(axis.tolist())
            stated = joint.removesuffix("_axis2").removesuffix("_axis")
            if joint in names and _is_rounded(deviation) and not written & {joint, stated}:
                message = f"the axis is {deviation:.2g} rad off {name} in the frame of the joint"
                yield Detection(None, joint, line, message)


def _is_rounded(deviation: float) -> bool:
    """Check whether Drake takes the coordinate axis for an axis that deviates from it."""
    return _NEGLIGIBLE_DEVIATION < deviation < DRAKE_DEVIATION


def _axes(case: Case) -> Iterator[tuple[Detection, Sequence[float], Callable[[str], Edit]]]:
    """Yield the axes in the text of a case: where each is, its numbers, and the edit that writes others."""
    source = case.source
    if case.form == "urdf":
        for element, axis in elements_in_joints(case, "axis", SINGLE):
            joint = case.model.joint(element.attributes["name"])
            yield found_at(axis, ""), joint.axis, partial(axis_edit, source, element)
    elif case.form == "mjcf":
        document = mjcf_text(case)
        for body in bodies_in_text(case, document):
            for element in body.children("joint"):
                attributes = with_defaults(document, element, body.childclass)
                numbers = _three_numbers(attributes.get("axis", "0 0 1"))
                if attributes.get("type", "hinge") in ("hinge", "slide") and numbers is not None:
                    place = Detection(None, element.attributes.get("name"), element.line, "")
                    yield place, numbers, partial(source.attribute_edit, element, "axis")
    else:
        for part in source.root.walk():
            model = part.parent
            nested = model is not None and model.parent is not None and model.parent.tag == "model"
            axes = [*part.all("axis"), *part.all("axis2")] if part.tag == "joint" else []
            for xyz in (each for found in axes for each in found.all("xyz")):
                numbers = _three_numbers(source.text_in(xyz))
                # The numbers of an axis in another frame are not those of its joint.
                if numbers is not None and "expressed_in" not in xyz.attributes:
                    place = Detection(None, None if nested else part.attributes.get("name"), xyz.line, "")
                    yield place, numbers, partial(_xyz_edit, source, xyz)


def _xyz_edit(source: XmlSource, xyz: SourceElement, axis: str) -> Edit:
    return source.replacement(xyz, f"<xyz>{axis}</xyz>")


def _three_numbers(text: str) -> list[float] | None:
    words = text.split()
    return [float(word) for word in words] if len(words) == 3 and all(map(is_number, words)) else None


def nearest_axis(axis: Sequence[float]) -> tuple[str, float]:
    """Find the coordinate axis nearest to an axis, and the deviation [rad] from it."""
    name, largest = max(zip(AXES, axis, strict=True), key=lambda pair: pair[1])
    others = [value for each, value in zip(AXES, axis, strict=True) if each != name]
    return name, math.atan2(math.hypot(*others), largest)
