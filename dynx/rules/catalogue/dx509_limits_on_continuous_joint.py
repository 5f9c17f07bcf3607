"""DX509 limits-on-continuous-joint: A continuous joint has a lower or an upper limit, which has no meaning
there.

``type="continuous"`` means a joint that rotates without limit; its ``lower`` and ``upper`` have no meaning.
Pinocchio and MuJoCo ignore them, PyBullet reports them in ``getJointInfo`` and does not apply them, and Drake
1.51 makes them the limits of the joint. The equations of motion are the same with all, but readers of the
file assume the range.

What to do: if the joint has a range, write ``type="revolute"`` and keep them. Else remove the two attributes,
so that the joint is unlimited in every engine; ``dynx doctor --fix`` does so with ``--choose DX509=drop``,
and by default leaves them.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, OptionalEditingRule, correction
from dynx.rules.joints import elements_in_joints

_RANGE = ("lower", "upper")


class LimitsOnContinuousJoint(OptionalEditingRule):
    advice = 'Remove the range, or write type="revolute" if the joint has a range.'
    choices = {
        "keep": "keep the limits of continuous joints, which have no meaning",
        "drop": "remove the lower and upper limits of continuous joints",
    }
    changed = "removed the lower and upper limits of continuous joints"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield continuous joints with `lower` or `upper`."""
        for _, limit in elements_in_joints(case, "limit", ("continuous",)):
            written = [end for end in _RANGE if end in limit.attributes]
            if written:
                listed = " and ".join(f'{end}="{limit.attributes[end]}"' for end in written)
                edits = tuple(case.source.attribute_removal(limit, end) for end in written)
                yield correction(limit, f"{listed} on a joint that rotates without limit", *edits)
