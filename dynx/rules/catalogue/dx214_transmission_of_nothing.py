"""DX214 transmission-of-nothing: A transmission lacks a part or names a missing joint.

Transmissions belong to ROS and its controllers. Of the engines only Drake reads them:

- Drake 1.51 refuses the file where a transmission has no type, no ``<joint>`` or no ``<actuator>`` with a
  name, or names a joint that the file does not have. It ignores types other than ``SimpleTransmission``.
- Pinocchio 4.1, PyBullet 3.2.7 and MuJoCo 4.0 ignore transmissions.

What to do: complete the transmission or remove it. ``dynx doctor --fix`` removes it; nothing in the dynamics
depends on it. If ROS controllers should use it, complete it instead.
"""

from collections.abc import Iterable

from dynx.errors import shown
from dynx.model.xml.source import SourceElement
from dynx.rules import Case, Correction, EditingRule, correction, measured_on
from dynx.rules.joints import transmissions_drake_reads, type_of


class TransmissionOfNothing(EditingRule):
    stage = "reading"
    advice = "Complete the <transmission>, or remove it."
    engines = measured_on("drake")
    changed = "removed transmissions that lack a part or a joint"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield such transmissions, of those that Drake reads."""
        for transmission in transmissions_drake_reads(case):
            message = _fault(case, transmission)
            if message is not None:
                yield correction(transmission, message, case.source.removal(transmission))


def _fault(case: Case, transmission: SourceElement) -> str | None:
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
