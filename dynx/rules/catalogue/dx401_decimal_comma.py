"""DX401 decimal-comma: A number is written with a comma instead of a decimal point.

URDF writes decimals with a point in every language, as XML Schema does. Programs that print numbers by the
current locale (a CAD exporter on a German or French computer) write a comma.

Each engine reads it differently:

- Pinocchio 4.1: with such a ``<mass>`` or ``<origin>`` of an ``<inertial>`` the whole inertial is dropped, so
  the link weighs nothing; with such an ``<inertia>`` only the tensor is dropped, so the link is a point
  mass. A line on stderr says so. In a ``<joint>`` the file is refused.
- PyBullet 3.2.7 reads up to the comma: ``2,5`` is 2, ``0,03`` is 0. It prints no warning. In a vector it does
  so with each of the three numbers.
- MuJoCo 4.0 refuses the file and names the line.
- Drake 1.51 reads up to the comma in a single number, as PyBullet does, and refuses a vector.

The effect is as large as the digits behind the comma: a mass of 2 instead of 2.5 kg, an inertia of 0 instead
of 0.03.

What to do: write a point. ``dynx doctor --fix`` does so in every number of links and joints.

There is one other reading: ``1,250`` may be one thousand two hundred and fifty, written with a comma between
thousands. dynx reads the comma as a decimal point unless the user chooses ``--choose DX401=thousands``. A
number with commas and a point, ``1,250.5``, is unambiguous.
"""

from dynx.rules import EVERY_ENGINE, Case
from dynx.rules.numbers_in_text import MisspelledNumberRule, Misspelling


class DecimalComma(MisspelledNumberRule):
    advice = "Write decimals with a point."
    engines = EVERY_ENGINE
    choices = {
        "decimal": "read a comma in a number as its decimal point",
        "thousands": "read a comma in a number as standing between thousands",
    }
    changed = "wrote decimal points instead of commas"
    fault = "comma"
    description = "with a comma where {meant} needs a point"

    def text_for(self, case: Case, misspelling: Misspelling) -> str:
        """Return the number as the user chose to read it."""
        if self.chosen(case) == "thousands" and misspelling.otherwise is not None:
            return misspelling.otherwise
        return misspelling.meant
