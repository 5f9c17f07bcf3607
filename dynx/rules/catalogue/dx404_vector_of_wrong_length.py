"""DX404 vector-of-wrong-length: A vector has more or fewer than three numbers.

``rpy="-3.14159 1.57079 0 0"`` has one too many, ``xyz="0.2 0.1"`` one too few.

- Pinocchio 4.1 refuses the file where the vector is in a ``<joint>``; in an ``<inertial>`` it drops the whole
  inertial with a line on stderr, so the link weighs nothing.
- PyBullet 3.2.7 uses the first three of four numbers without a warning. With two it prints a warning and uses
  zeros for all three; in an ``<axis>`` it refuses the file.
- MuJoCo 4.0 and Drake 1.51 refuse the file.

The effect of a vector that became zero is of order 1 in the positions of all links behind it. Of the files
that come with PyBullet, ``quadruped/microtaur/microtaur.urdf`` has vectors of four numbers.

What to do: find out which three numbers were intended. ``dynx doctor --fix`` keeps the first three, as
PyBullet does, and adds zeros where numbers are missing, as a person would read the file. With
``--choose DX404=default`` it removes the attribute instead, so that the default applies: zero for an origin,
(1, 0, 0) for an axis.
"""

from dynx.model.xml.source import Edit
from dynx.rules import EVERY_ENGINE, Case
from dynx.rules.numbers_in_text import MisspelledNumberRule, Misspelling, NumericAttribute


class VectorOfWrongLength(MisspelledNumberRule):
    advice = "Write three numbers."
    engines = EVERY_ENGINE
    choices = {
        "first": "keep the first three numbers of a vector, and add zeros where some are missing",
        "default": "remove a vector without three numbers",
    }
    changed = "made vectors have three numbers"
    fault = "count"
    description = "which has {count} numbers where three are wanted"
    elements = ("origin", "axis")

    def edit(self, case: Case, attribute: NumericAttribute, misspelling: Misspelling) -> Edit:
        """Correct or remove the vector, by the user's choice."""
        if self.chosen(case) == "first":
            return super().edit(case, attribute, misspelling)
        if attribute.element.tag == "axis":
            return case.source.removal(attribute.element)
        return case.source.attribute_removal(attribute.element, attribute.name)
