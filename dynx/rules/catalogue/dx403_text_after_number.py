"""DX403 text-after-number: A number is followed by something that is no part of it.

A second point, a unit, a Fortran exponent (``1.5d-3``), a hexadecimal number.

- Pinocchio 4.1: with such a ``<mass>`` or ``<origin>`` of an ``<inertial>`` the whole inertial is dropped, so
  the link weighs nothing; with such an ``<inertia>`` the tensor alone is, so the link is a point mass. A line
  on stderr says so. In a ``<joint>`` the file is refused.
- PyBullet 3.2.7 reads the number in front and passes over the rest, without a word. ``1.5d-3`` is
  then 1.5, a thousand times too large.
- MuJoCo 4.0 refuses the file and names the line, but reads hexadecimal numbers.
- Drake 1.51 reads single numbers as PyBullet does and refuses vectors; a hexadecimal number is 0 to it.

The effect is nothing at all (a limit that is not used) up to a link without mass. Of the files that come
with PyBullet, ``biped/biped2d_pybullet.urdf`` has ``-1.57.``.

What to do: write the bare number, in SI units. ``dynx doctor --fix`` keeps the number in front; a Fortran
exponent is rewritten with ``e``, a hexadecimal number in decimals. It never converts units: ``25mm`` would
become 25, so look at what it changed. Words with no number in front (``heavy``, ``${mass}``) are beyond
mending and stay an error.
"""

from dynx.rules import EVERY_ENGINE, Case
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule


class TextAfterNumber(MisspelledNumberRule):
    advice = "Write the bare number, in SI units."
    engines = EVERY_ENGINE
    changed = "kept the number where something stood behind it"
    fault = "rest"
    description = "which is no decimal number; {meant} is what can be read of it"

    def decision(self, case: Case) -> str | None:
        """There is one reading; it is still a guess."""
        return f"{self.id}: the number in front was kept, and no unit converted"
