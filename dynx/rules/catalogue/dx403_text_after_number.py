"""DX403 text-after-number: A number is followed by text that does not belong to it.

A second point, a unit, a Fortran exponent (``1.5d-3``), a hexadecimal number.

- Pinocchio 4.1: with such a ``<mass>`` or ``<origin>`` of an ``<inertial>`` the whole inertial is dropped, so
  the link weighs nothing; with such an ``<inertia>`` only the tensor is dropped, so the link is a point mass.
  A line on stderr says so. In a ``<joint>`` the file is refused.
- PyBullet 3.2.7 reads the number at the beginning and ignores the rest, without a warning. ``1.5d-3`` is then
  1.5, a thousand times too large.
- MuJoCo 4.0 refuses the file and names the line, but reads hexadecimal numbers.
- Drake 1.51 reads single numbers as PyBullet does and refuses vectors; it reads a hexadecimal number as 0.

The effect ranges from none (a limit that is not used) to a link without mass. Of the files that come with
PyBullet, ``biped/biped2d_pybullet.urdf`` has ``-1.57.``.

What to do: write the number alone, in SI units. ``dynx doctor --fix`` keeps the number at the beginning; a
Fortran exponent is rewritten with ``e``, a hexadecimal number in decimals. It never converts units: ``25mm``
would become 25, so check its changes. Words with no number at the beginning (``heavy``) are DX420.
"""

from dynx.rules import EVERY_ENGINE, Case
from dynx.rules.numbers_in_text import MisspelledNumberRule


class TextAfterNumber(MisspelledNumberRule):
    advice = "Write the number alone, in SI units."
    engines = EVERY_ENGINE
    changed = "kept the number where something followed it"
    fault = "rest"
    description = "which is no decimal number; {meant} is the readable part"

    def decision(self, case: Case) -> str | None:
        """Write the decision: there is one reading, and it is a guess."""
        return f"{self.id}: the number at the beginning was kept, and no unit was converted"
