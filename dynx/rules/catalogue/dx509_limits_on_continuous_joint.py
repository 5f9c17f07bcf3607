"""DX509 limits-on-continuous-joint: A continuous joint has a lower or an upper limit, which has no meaning
there.

``type="continuous"`` means a joint that turns for ever; its ``lower`` and ``upper`` have no meaning.
Pinocchio and MuJoCo pass them over, PyBullet reports them in ``getJointInfo`` and does not apply them, and
Drake 1.51 makes them the limits of the joint. The equations of motion are the same with all, and somebody
who reads the file believes the range.

What to do: if the joint does have ends, write ``type="revolute"`` and keep them. Else take the two attributes
away, so that every engine has a joint without end; ``dynx doctor --fix`` does so with
``--choose DX509=drop``, and by default leaves them.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.joints.elements import elements_in_joints

_RANGE = ("lower", "upper")


class LimitsOnContinuousJoint(OptionalEditingRule):
    advice = 'Take the range away, or write type="revolute" if the joint does have ends.'
    choices = {
        "keep": "leave the limits of continuous joints, which mean nothing",
        "drop": "take the lower and upper limits of continuous joints away",
    }
    changed = "took the lower and upper limits of continuous joints away"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Continuous joints with `lower` or `upper`."""
        for _, limit in elements_in_joints(case, "limit", ("continuous",)):
            written = [end for end in _RANGE if end in limit.attributes]
            if written:
                said = " and ".join(f'{end}="{limit.attributes[end]}"' for end in written)
                edits = tuple(case.source.removing_attribute(limit, end) for end in written)
                yield correction(limit, f"{said} on a joint that turns for ever", *edits)
