"""Links without mass or without a complete inertial."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from dynx.errors import escaped
from dynx.model.elements import Inertial
from dynx.model.xml.source import Edit, SourceElement
from dynx.rules import (
    EVERY_ENGINE,
    Case,
    Correction,
    Detection,
    EditingRule,
    Remedy,
    Rule,
    correction,
    found_at,
    links_of,
    measured_on,
)
from dynx.rules.attributes import completion, misspelled_numbers, number_or_none, positive_edit, renaming
from dynx.rules.inertia import (
    LEAST_MASS,
    ZERO_TENSOR,
    has_inertial_data,
    heaviest_in_root_group,
    inertials_in_groups,
    massless_links,
    merged_inertials,
    rigid_groups,
    static_links,
    tensor_fault,
    with_inertials,
    with_least_inertia,
    zero_inertial,
)
from dynx.rules.joints import text_in
from dynx.rules.numbers_in_text import is_number

_WORLD = "world"
"""Name of a link without ``<inertial>`` that PyBullet gives no mass."""


_READINGS = (
    ("pinocchio", "no mass in Pinocchio"),
    ("pybullet", "1 kg and 1 kg m^2 in PyBullet"),
    ("mujoco", "the weight of its shapes in MuJoCo"),
    ("drake", "no mass in Drake"),
)


class LinkWithoutInertial(Rule):
    """DX101 link-without-inertial: A link has no <inertial>: some engines give it a mass, others none.

    A link that only marks a place, such as a tool flange or a camera frame, is often written without an
    ``<inertial>`` element. URDF does not define the mass of such a link.

    - Pinocchio 4.1.0, Drake 1.51.1 and dynx give the link no mass.
    - PyBullet 3.2.7 gives it 1 kg, with 1 kg m^2 about every axis, unless the link is named exactly
      ``world``. PyBullet prints "No inertial data for link, using mass=1" among other output.
    - MuJoCo 4.0.0 gives it the mass of its primitive collision shapes at 1000 kg/m^3. Without such shapes the
      link has no mass.

    The effect is large: torques, mass matrices and accelerations are off by 10 % to many times their size if
    the link moves. With a floating base, the root link also moves. With a fixed base, the root link and the
    links rigidly connected to it cannot move. Their mass has no effect, so the report does not list them.

    What to do: write the mass and the inertia of the link. If the link is only a frame, write zeros.

    ``dynx doctor --fix`` writes an ``<inertial>`` with mass 0 and moments 0 into each such link. All four
    engines then read the link as a frame, as Pinocchio does. A root link of a floating base is an exception,
    because PyBullet fixes a root without mass to the world (DX107). This root gets the inertia of the
    heaviest link that is rigidly connected to it, and that link gets zeros. This changes no equation of
    motion.
    """

    engines = measured_on("pybullet", "mujoco")
    advice = "Write an <inertial> with the true numbers, or with zeros if the link is only a frame."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links that can move and have no ``<inertial>``."""
        if not has_inertial_data(case):
            return  # DX118
        static = static_links(case)
        for name, element in case.links.items():
            if element.first("inertial") is None and name not in static and name != _WORLD:
                yield Detection(name, None, element.line, "no <inertial>", _READINGS)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Write an inertial of zero into each link.

        A floating root gets that of the heaviest link rigidly connected to it instead, since PyBullet fixes a
        root without mass to the world (DX107).
        """
        names = links_of(detections)
        many = f"{len(names)} links" if len(names) > 1 else "the link"
        done = f"gave {many} without <inertial> one with mass 0 and moments 0"
        body = heaviest_in_root_group(case) if case.base == "floating" and case.readable else None
        if body is not None and case.model.root in names:
            root = case.model.root
            merged = merged_inertials(case, rigid_groups(case)[root], (root, body), root)
            case = with_inertials(case, merged)
            names.remove(root)
            done = f"gave the root {root} the <inertial> of {body}, which is rigidly connected to it"
            done += f", and {len(names)} other links without <inertial> one of zero" if names else ""
        source = case.source
        edits = [source.insertion(case.links[name], zero_inertial(), first=True) for name in names]
        return Remedy(case.with_source(source.apply(*edits)), done)


class MasslessRoot(Rule):
    """DX107 massless-root: With a floating base PyBullet fixes a robot to the world if its root link has no
    mass.

    In many robots the root link is empty, such as ``base_link``, and a fixed joint connects it to the body of
    the robot. With a fixed base this is harmless. With a floating base, the root moves:

    - PyBullet 3.2.7 reads mass 0 as "fixed to the world", even with ``useFixedBase=False``. The robot hangs
      in the air, and its base has no coordinates.
    - MuJoCo 4.0.0 merges the root with the links that are rigidly connected to it, so it is not affected. If
      there are no such links, it refuses the file ("mass and inertia of moving bodies must be larger than
      mjMINVAL").
    - Pinocchio 4.1.0 and Drake 1.51.1 are not affected.

    The effect: in PyBullet the robot does not float.

    What to do: give the root the mass of the body that it represents.

    ``dynx doctor --fix`` moves the inertia of one link to the root: the heaviest link that is rigidly
    connected to the root. This link gets a zero inertia, and keeps its name and its place. The equations of
    motion are the same. If no link rigidly connected to the root has mass, the root gets 2e-15 kg and 1.5e-14
    kg m^2. All engines accept these numbers, which are too small to show in any result.
    ``--choose DX107=keep`` leaves the root unchanged. If no link of the robot has mass, see DX118.
    """

    engines = measured_on("pybullet")
    advice = "Give the root link the mass of the body that it represents."
    choices = {
        "lump": "merge the root with the heaviest rigidly connected link; without one, write the least mass",
        "keep": "keep the file; PyBullet then fixes the robot to the world",
    }
    trap_base = "floating"

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the root, on the floating base, where the file says that its mass is zero."""
        model = case.model
        inertial = case.inertials[model.root]
        # Without an <inertial> PyBullet gives the root 1 kg (DX101), unless it is named world.
        weightless = model.root == "world" if inertial is None else inertial.mass == 0.0
        if case.base != "floating" or not weightless or not has_inertial_data(case):
            return []
        element = case.links[model.root]
        line = element.line if inertial is None else inertial.line
        body = heaviest_in_root_group(case)
        where = "nor has any link rigidly connected to it" if body is None else f"the body is the link {body}"
        return [Detection(model.root, None, line, f"the root has no mass; {where}")]

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the heaviest link rigidly connected to the root merged into it."""
        root, body = case.model.root, heaviest_in_root_group(case)
        if self.chosen(case) == "keep":
            return None
        if body is None:
            return Remedy(*with_least_inertia(case, [root]), self.decision(case))
        bodies = merged_inertials(case, rigid_groups(case)[root], (root, body), root)
        return Remedy(with_inertials(case, bodies), f"merged the mass of {body} into the root {root}")


_READINGS_OF_TENSOR = (("mujoco", "dropped or refused by MuJoCo"), ("drake", "1 kg in Drake"))


class MasslessLinkWithInertia(Rule):
    """DX108 massless-link-with-inertia: A link of mass zero has moments of inertia, which no body has.

    A body with moments of inertia has mass. Such a file mostly comes from an edit: the mass of a foot or a
    sensor was set to zero, and its tensor was kept.

    - Drake 1.51.1 gives the link a mass of 1 kg, with a warning ("condition 'mass > 0' failed").
    - MuJoCo 4.0.0 drops the tensor if the link is rigidly connected to another link (MuJoCo's default
      ``fusestatic``). If the link moves by itself, MuJoCo refuses the file. If the link cannot move, MuJoCo
      refuses only a tensor that no body can have ("inertia must satisfy A + B >= C").
    - Pinocchio 4.1.0 and PyBullet 3.2.7 use the numbers unchanged, as dynx does.

    For example, the feet of the robot bolt have no mass. In Drake the torques of this robot are up to 23
    times too large, and in MuJoCo they are off by 1e-4.

    What to do: give the link its mass.

    ``dynx doctor --fix`` adds the tensor to that of another link with mass, which is rigidly connected to the
    massless link. If possible, this other link is the parent. The massless link gets a zero tensor. The
    equations of motion are the same. If there is no such link, the massless link gets a mass of 2e-15 kg.
    Every engine accepts this mass, which is too small to show in any result. If the massless link cannot
    move, its tensor becomes zero.
    """

    engines = measured_on("drake", "mujoco")
    advice = "Give the link its mass, or move the tensor into the link that it is rigidly connected to."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links of mass zero with a tensor that is not zero; of those that cannot move, the links
        whose tensor no body can have."""
        for name, inertial, group in inertials_in_groups(case):
            largest = float(np.max(np.abs(inertial.tensor)))
            if inertial.mass != 0.0 or largest == 0.0:
                continue
            message = f"the mass is zero, and the largest entry of the tensor {largest:.6g}"
            if not group.static:
                yield Detection(name, None, inertial.line, message, _READINGS_OF_TENSOR)
            elif tensor_fault(inertial) == "triangle":
                message += ", in a tensor that no body can have, held still by the world"
                yield Detection(name, None, inertial.line, message, (("mujoco", "refused by MuJoCo"),))

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy:
        """Return the case with each tensor moved to a link with mass, or with the least mass added."""
        moved, removed, invented = 0, 0, 0
        for name in links_of(detections):
            inertial, group = case.model.inertial(name), rigid_groups(case)[name]
            if group.static:
                case = with_inertials(case, {name: Inertial(0.0, inertial.origin)})
                removed += 1
                continue
            parent = group.parents.get(name)
            near = [*([parent] if parent else []), *group.children(name), *group.links]
            heavy = [each for each in near if (body := case.inertials[each]) is not None and body.mass > 0.0]
            if heavy:
                case = with_inertials(case, merged_inertials(case, group, (heavy[0], name), heavy[0]))
                moved += 1
            else:
                case = with_inertials(case, {name: replace(inertial, mass=LEAST_MASS)})
                invented += 1
        done = (
            (moved, "added tensors of links without mass to links with mass rigidly connected to them"),
            (removed, "removed tensors of links without mass that cannot move"),
            (invented, f"gave links with a tensor and without mass {LEAST_MASS:g} kg"),
        )
        return Remedy(case, "; ".join(sentence for count, sentence in done if count))


class MasslessMovingLink(Rule):
    """DX110 massless-moving-link: A joint carries a link without mass; MuJoCo refuses it although further
    links have mass.

    Links without mass between two joints are common: a shoulder of three axes is mostly written as three
    joints with two empty links between them. The motion is well defined, because the last joint carries a
    link with mass.

    - MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL"), unless
      a link with mass is rigidly connected to the empty link.
    - Pinocchio 4.1.0, PyBullet 3.2.7 and Drake 1.51.1 accept such links.

    The effect: the file does not load in MuJoCo.

    What to do: the robot is correct. For MuJoCo, give the link a mass that is too small to measure.

    ``dynx doctor --fix`` gives the link 2e-15 kg and 1.5e-14 kg m^2 about every axis, just above the smallest
    numbers that MuJoCo accepts. In a robot of kilograms and metres these numbers have less effect than
    rounding. ``--choose DX110=keep`` keeps the file. If no link beyond the joint has mass, see DX113.
    """

    engines = measured_on("mujoco")
    advice = "For MuJoCo, give the link a mass just above 1e-15 kg and moments just above 1e-14 kg m^2."
    choices = {
        "least": "give the link the least mass and moments that MuJoCo accepts",
        "keep": "keep the file; MuJoCo refuses it",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the moving links without mass and tensor that carry a link with mass or tensor."""
        message = "a joint carries the link, which has neither mass nor inertia"
        for name, bare in massless_links(case).items():
            if not bare:
                yield Detection(name, None, case.links[name].line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the case with the least mass and moments that MuJoCo accepts."""
        if self.chosen(case) == "keep":
            return None
        return Remedy(*with_least_inertia(case, links_of(detections)), self.decision(case))


class MassMatrixSingular(Rule):
    """DX113 mass-matrix-singular: Nothing beyond a joint has mass, so the mass matrix is singular.

    In some files the last links of a chain have no inertia. Examples are fingers, wheels and rotating
    sensors. To move them needs no torque, so their acceleration is undefined: the mass matrix is singular,
    and forward dynamics has no unique solution.

    - Pinocchio 4.1.0 returns NaN for all joints.
    - PyBullet 3.2.7 returns an acceleration of zero for such a joint, and the right acceleration for all
      other joints.
    - Drake 1.51.1 raises an error ("mass matrix ... is not positive-definite").
    - MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
    - Kinematics, mass matrix and inverse dynamics are right in Pinocchio, PyBullet and Drake.

    The effect: there is no forward dynamics, and each engine reports this in a different way. The robot romeo
    has 24 such joints.

    What to do: enter the inertia. If the joint does not matter, make it fixed.

    ``dynx doctor --fix`` gives such links 2e-15 kg and 1.5e-14 kg m^2 about every axis, the least that all
    engines accept. All engines then return the same accelerations, to rounding. The report says that the
    physics changed: this inertia is invented, and a very small torque causes a very large acceleration.
    ``--choose DX113=keep`` keeps the file.
    """

    # The others show it in forward dynamics, which has no right value to compare with.
    engines = measured_on("mujoco")
    advice = "Enter the inertia of the link, or make the joint fixed if it does not matter."
    choices = {
        "least": "give the links the least mass and moments that engines accept; this changes the physics",
        "keep": "keep the file; forward dynamics has no solution",
    }

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the moving links where neither they nor any link beyond them has mass or a tensor."""
        message = "neither the link nor anything beyond its joint has mass: the mass matrix is singular"
        for name, bare in massless_links(case).items():
            if bare:
                yield Detection(name, None, case.links[name].line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Give the links the least inertia that all engines accept, unless the user keeps the file."""
        if self.chosen(case) == "keep":
            return None
        return Remedy(
            *with_least_inertia(case, links_of(detections)), self.decision(case), changes_physics=True
        )


class NoInertialData(Rule):
    """DX118 no-inertial-data: No moving link has mass or inertia, so there is no dynamics to compare.

    Files for display, for motion planning or from a CAD export without materials often have no
    ``<inertial>``, or only zeros in each ``<inertial>``. Such a file states the kinematics of a robot and
    nothing about its dynamics:

    - Pinocchio 4.1.0 and Drake 1.51.1 load it with a mass matrix of zero. Pinocchio then gives NaN for
      accelerations, and Drake an error.
    - PyBullet 3.2.7 gives 1 kg and 1 kg m^2 about every axis to each link without ``<inertial>``. If the root
      has an ``<inertial>`` of zero, PyBullet fixes a floating robot to the world.
    - MuJoCo 4.0.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL"), unless
      the links have collision shapes other than meshes. From these MuJoCo computes a mass.

    The effect: torques, mass matrices and accelerations of this robot have no meaning in any engine. The
    doctor compares only poses and Jacobians.

    What to do: enter the masses and inertias, from the data sheet or the CAD model.

    ``dynx doctor --fix`` does not invent inertias. So the report does not say that the engines agree.
    ``--choose DX118=least`` gives every moving body 2e-15 kg and 1.5e-14 kg m^2. All engines then load the
    file. Do not simulate the result: a torque of 1e-6 N m accelerates a joint to millions of rad/s. If only
    some moving links have no mass, see DX110 and DX113.
    """

    engines = measured_on("pybullet", "mujoco")
    undefined = "dynamics"
    advice = "Enter the masses and inertias; until then use the file for kinematics only."
    choices = {
        "keep": "invent no inertia, and compare the kinematics",
        "least": "give every moving body the least mass and moments that engines accept, which changes the "
        "physics",
    }
    trap_base = "floating"

    @classmethod
    def holds_for(cls, versions: Mapping[str, str]) -> bool:
        """Return True: what the file does not state is missing in every engine."""
        return True

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the robot, where nothing that moves has mass or moments."""
        if has_inertial_data(case):
            return
        missing = sum(element.first("inertial") is None for element in case.links.values())
        count = len(case.links)
        message = (
            "no link has an <inertial>"
            if missing == count
            else f"of {count} links {missing} have no <inertial>, and no other that moves has mass or moments"
        )
        yield Detection(None, None, case.source.root.line, message)

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the least inertia for each moving body, if that was chosen."""
        if self.chosen(case) == "keep":
            return None
        groups = dict.fromkeys(rigid_groups(case).values())
        moving = [group.head for group in groups if not group.static]
        least = with_least_inertia(case, moving)
        return Remedy(*least, self.decision(case), changes_physics=True)


class NegativeMass(EditingRule):
    """DX120 negative-mass: The mass of a link is negative.

    No body has a negative mass. Usual causes are an edit by hand, an exporter that subtracts a hole, and a
    "correction" of the total mass of several links.

    If the link moves:

    - Pinocchio 4.1 adds inertias, and divides their first moment by the larger of the mass and 2e-16 kg. The
      centre of mass of the link is then at a distance of 1e20 m or more, and torques are above 1e40 N m.
    - PyBullet 3.2.7 loads the file, and inverse dynamics and the mass matrix fail ("invalid mass").
    - MuJoCo 4.0 refuses the file ("mass and inertia of moving bodies must be larger than mjMINVAL").
    - Drake 1.51 replaces the inertia by that of a ball of water of 1 kg, with a warning.

    dynx refuses the file, and names the line.

    What to do: enter the mass of the body. ``dynx doctor --fix`` removes the sign. This is a guess, and the
    report says so. ``--choose DX120=zero`` writes 0 instead.
    """

    stage = "reading"
    advice = "Enter the mass of the body, in kilograms."
    engines = EVERY_ENGINE
    choices = {
        "absolute": "remove the sign of a negative mass",
        "zero": "make a negative mass zero",
    }
    changed = "made the mass of links positive or zero"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the mass that engines read in each link."""
        for link in case.source.root.all("link"):
            inertial = link.first("inertial")
            mass = None if inertial is None else inertial.first("mass")
            if mass is not None and (number_or_none(mass, "value") or 0.0) < 0.0:
                edit, written = positive_edit(case, mass, "value", zero=self.chosen(case) == "zero")
                yield correction(mass, f"the link has a mass of {written} kg", edit)


_MOMENTS = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")


class MissingProductOfInertia(EditingRule):
    """DX409 missing-product-of-inertia: An inertia tensor is written without its zero products.

    Tensors written by hand often omit the products of inertia that are zero. URDF requires all six numbers.
    Some engines accept fewer, some refuse the file.

    - Pinocchio 4.1 prints on stderr that ``ixy`` is missing and drops the whole tensor: the link is a point
      mass.
    - MuJoCo 4.0 refuses the file and names the line.
    - PyBullet 3.2.7 and Drake 1.51 read zero.

    The effect in Pinocchio is a link without moments of inertia. The relative error of the mass matrix is of
    order 0.01 to 1.

    What to do: write all six numbers. ``dynx doctor --fix`` corrects a misspelled name, such as
    ``iyx="0.01"``. For a missing product it writes ``0``. For a missing moment (``ixx``, ``iyy``, ``izz``)
    see DX410.
    """

    stage = "reading"
    advice = "Write all six numbers of the tensor."
    engines = measured_on("pinocchio", "mujoco")
    unambiguous = True
    changed = "wrote the products of inertia that were missing as 0"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield tensors with all three moments and not all products."""
        for tensor in case.elements("link", "inertial", "inertia"):
            missing = [name for name in _PRODUCTS if name not in tensor.attributes]
            if missing and all(name in tensor.attributes for name in _MOMENTS):
                yield completion(case, tensor, f"<inertia> has no {' and no '.join(missing)}", missing, "0")


class IncompleteInertial(EditingRule):
    """DX410 incomplete-inertial: An inertial has no mass or no inertia tensor.

    ``<inertial>`` needs both ``<mass value="..."/>`` and ``<inertia .../>``. A common mistake is
    ``<mass>2.5</mass>``, which no engine reads. A tensor without ``ixx``, ``iyy`` or ``izz`` also counts as
    missing, such as an ``<inertia/>`` that remained from a template.

    - Pinocchio 4.1 prints a line on stderr. Without a mass it drops the whole inertial, so the link has no
      mass. Without a tensor the link is a point mass.
    - PyBullet 3.2.7 and MuJoCo 4.0 refuse the file.
    - Drake 1.51 reads missing parts as zero. So a link with a mass and no tensor is a point mass. An
      ``<inertial>`` with a tensor and no mass is physically impossible. Drake replaces it, with a warning.

    The effect is a file that does not load, or a link without its mass. The relative error of the mass matrix
    is then of order 0.01 to 1.

    What to do: complete the ``<inertial>``. ``dynx doctor --fix`` corrects a misspelled name, such as
    ``<mass valeu="1.5"/>`` or ``ixxx="0.02"``. In other cases it guesses, and the report says so. It reads
    the number in ``<mass>2.5</mass>`` as the mass. It drops a tensor without mass, so the link has no mass. A
    mass without tensor becomes a point mass at the origin of the inertial, as in Pinocchio and Drake.
    ``--choose DX410=weightless`` also drops this mass.
    """

    stage = "reading"
    advice = "Give every <inertial> a <mass value> and an <inertia>."
    engines = EVERY_ENGINE
    choices = {
        "point": "write zeros for an inertial without mass; make an inertial without tensor a point mass",
        "weightless": "write zeros for an inertial without mass or without tensor",
    }
    changed = "completed inertials that had no mass or no tensor"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the first inertial of each link, where it lacks something."""
        for link in case.source.root.all("link"):
            inertial = link.first("inertial")
            if inertial is not None:
                yield from self._in(case, inertial)

    def _in(self, case: Case, inertial: SourceElement) -> Iterable[Correction]:
        mass, tensor = inertial.first("mass"), inertial.first("inertia")
        misspelled = [
            found
            for element, names in ((mass, ("value",)), (tensor, _MOMENTS))
            if element is not None and (found := _misspelled_attributes(case, element, names)) is not None
        ]
        if misspelled:
            yield from misspelled
            return
        if mass is not None and "value" in mass.attributes:
            missing = [name for name in _MOMENTS if tensor is not None and name not in tensor.attributes]
            if tensor is None or missing:
                what = (
                    f"<inertia> has no {' and no '.join(missing)}"
                    if missing
                    else "<inertial> has no <inertia>"
                )
                yield correction(inertial, what, *self._without_tensor(case, inertial, tensor))
            return
        inside = "" if mass is None else text_in(case.source, mass)
        if mass is None or not is_number(inside):
            message = "<inertial> has no <mass>" if mass is None else "<mass> has no value"
            yield correction(inertial, message, case.source.replacement(inertial, zero_inertial()))
        else:
            edit = case.source.replacement(mass, f'<mass value="{inside}"/>')
            yield correction(mass, f"<mass> has {inside} between its tags and no value", edit)

    def _without_tensor(
        self, case: Case, inertial: SourceElement, tensor: SourceElement | None
    ) -> tuple[Edit, ...]:
        if self.chosen(case) == "weightless":
            return (case.source.replacement(inertial, zero_inertial()),)
        if tensor is not None:
            return (case.source.replacement(tensor, ZERO_TENSOR),)
        return (case.source.insertion(inertial, ZERO_TENSOR),)


def _misspelled_attributes(case: Case, element: SourceElement, names: Sequence[str]) -> Correction | None:
    """Return the correction of the names of attributes, where each that is missing has its number under a
    name that is close to it."""
    missing = [name for name in names if name not in element.attributes]
    meant = misspelled_numbers(element, missing)
    if not missing or len(meant) < len(missing):
        return None
    edits = [edit for right in missing for edit in renaming(case, element, meant[right], right)]
    texts = [f"{right} {element.attributes[meant[right]]} in {escaped(meant[right])}" for right in missing]
    detection = found_at(element, f"<{element.tag}> has its {' and its '.join(texts)}")
    return Correction(detection, tuple(edits), tuple(missing), whole=True)
