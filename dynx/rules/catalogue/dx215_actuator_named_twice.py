"""DX215 actuator-named-twice: The actuators of two transmissions have the same name.

Transmissions belong to ROS, where each is independent. Drake 1.51 reads them and makes an actuator of each,
whose names must be unique: it refuses the file, "already contains a joint actuator named".

Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore transmissions.

Transmissions of fixed joints, of joints with an effort limit of 0, and of other types than
``SimpleTransmission`` are ignored.

A copied transmission of which only the joint was changed causes this; ``xarm6_robot.urdf``, which comes with
PyBullet, has two actuators ``motor3``.

What to do: give each actuator its own name. ``dynx doctor --fix`` adds a number to the later ones.
"""

from collections.abc import Iterable, Iterator

from dynx.errors import shown
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import fresh_name, moves_by_actuator, transmissions_drake_reads


class ActuatorNamedTwice(EditingRule):
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
