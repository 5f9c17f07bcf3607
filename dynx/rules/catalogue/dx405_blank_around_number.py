"""DX405 blank-around-number: blanks stand in front of or behind a number, as in ``value=" 2.5 "``

It looks like the most harmless thing in a file. Pinocchio 4.1 (its reader is urdfdom) wants the attribute
to be the number and nothing else:

- in an ``<inertial>`` it says on stderr that the mass "is not a float" and drops the whole inertial, so
  the link weighs nothing;
- in a ``<limit>``, ``<dynamics>`` or ``<mimic>`` of a joint it refuses the file.

PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 read the number. So does dynx. Blanks between and around the three
numbers of a vector are fine everywhere (tabs are not, see DX406).

The effect is a link without mass or inertia: the mass matrix is off by as much as the link matters, of
order 0.01 to 1.

What to do: take the blanks away. ``dynx doctor --fix`` does so and changes no digit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from dynx.rules.misspelled_numbers import MisspelledNumberRule
from dynx.rules.number_text import Fault
from dynx.rules.numeric_attributes import NumericAttribute

_READ_ALL_THE_SAME = ("box", "sphere", "cylinder", "capsule", "mesh")


class BlankAroundNumber(MisspelledNumberRule):
    """DX405."""

    id = "DX405"
    name = "blank-around-number"
    title = "White space stands in front of or behind a number."
    advice = "Take the white space away."
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0"}
    changed = "took white space around numbers away"
    fault: ClassVar[Fault] = "blank"

    def said(self, written: str, meant: str) -> str:
        """The same for all."""
        return "with white space around the number"

    def applies(self, attribute: NumericAttribute) -> bool:
        """Not to the sizes of shapes, which all engines read so."""
        return attribute.element.tag not in _READ_ALL_THE_SAME
