"""Transmissions and the actuators in them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from dynx.errors import shown
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import fresh_name, moves_by_actuator, transmissions_drake_reads, type_of


class TransmissionOfNothing(EditingRule):
    """DX214 transmission-of-nothing: A transmission lacks a part or names a missing joint.

    Transmissions belong to ROS and its controllers. Of the engines only Drake reads them:

    - Drake 1.51 refuses the file if a transmission has no type, no named ``<joint>`` or no named
      ``<actuator>``. It also refuses a transmission of a joint that the file does not have. It ignores types
      other than ``SimpleTransmission``.
    - Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore transmissions.

    What to do: if ROS controllers use the transmission, complete it; otherwise remove it.
    ``dynx doctor --fix`` removes it. The dynamics does not depend on it.
    """

    stage = "reading"
    advice = "Complete the <transmission>, or remove it."
    engines = measured_on("drake")
    changed = "removed transmissions that lack a part or a joint"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such transmissions, of those that Drake reads."""
        for transmission in transmissions_drake_reads(case):
            message = _transmission_fault(case, transmission)
            if message is not None:
                yield correction(transmission, message, case.source.removal(transmission))


def _transmission_fault(case: Case, transmission: SourceElement) -> str | None:
    if type_of(case, transmission) is None:
        return "<transmission> has no type"
    for tag in ("actuator", "joint"):
        part = transmission.first(tag)
        if part is None:
            return f"<transmission> has no <{tag}>"
        name = part.attributes.get("name", "")
        if not name:
            return f"<{tag}> of <transmission> has no name"
    return (
        None if name in case.joints else f"<transmission> is about joint {shown(name)}, which does not exist"
    )


class ActuatorNamedTwice(EditingRule):
    """DX215 actuator-named-twice: The actuators of two transmissions have the same name.

    Transmissions belong to ROS, where two of them may have actuators of the same name. Drake 1.51 adds an
    actuator for each transmission, and refuses a second actuator of the same name ("already contains a joint
    actuator named"). Drake ignores transmissions of fixed joints, of joints with an effort limit of 0, and of
    other types than ``SimpleTransmission``. Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore all
    transmissions.

    Usually someone copied a transmission and changed only the joint. For example, ``xarm6_robot.urdf``, which
    comes with PyBullet, has two actuators ``motor3``.

    What to do: give each actuator its own name. ``dynx doctor --fix`` adds a number to the second and later
    names.
    """

    stage = "reading"
    advice = "Give each actuator its own name."
    engines = measured_on("drake")
    changed = "gave actuators of the same name different ones"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the actuators, of those that Drake makes, whose name occurs before."""
        actuators = list(_actuators(case))
        taken = {each.attributes["name"] for each in actuators}
        seen = set()
        for actuator in actuators:
            name = actuator.attributes["name"]
            if name in seen:
                new = fresh_name(name, taken)
                taken.add(new)
                edit = case.source.attribute_edit(actuator, "name", new)
                yield correction(actuator, f"a further actuator has the name {shown(name)}", edit)
            seen.add(name)


def _actuators(case: Case) -> Iterator[SourceElement]:
    for transmission in transmissions_drake_reads(case):
        actuator = transmission.first("actuator")
        if actuator is not None and "name" in actuator.attributes and moves_by_actuator(case, transmission):
            yield actuator
