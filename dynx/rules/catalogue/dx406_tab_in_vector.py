"""DX406 tab-in-vector: The numbers of a vector are separated by a tab, a line break or another blank.

XML calls tabs and line breaks white space like blanks, and a vector over two lines looks correct. Copied text
can hold another kind of blank, such as the no-break space U+00A0.

- Pinocchio 4.1 separates numbers at blanks alone. A tab in a vector of a ``<joint>`` makes it refuse the
  file; in an ``<inertial>`` it drops the whole inertial with a line on stderr, so the link weighs nothing.
- PyBullet 3.2.7 separates numbers at blanks alone too. It finds one word instead of three, prints a warning
  and uses zeros. Where there are both blanks and line breaks it can find three words that are not the three
  numbers. A tab in an ``<axis>`` makes it refuse the file.
- MuJoCo 4.0 and Drake 1.51 read tabs and line breaks as intended, and refuse the no-break space.

The effect is that of a missing offset: of order 1 in the positions of all links behind it, 0.1 in the mass
matrix of a small arm.

What to do: separate numbers by blanks. ``dynx doctor --fix`` does so and changes no digit.
"""

from dynx.rules import measured_on
from dynx.rules.numbers_in_text import MisspelledNumberRule


class TabInVector(MisspelledNumberRule):
    advice = "Separate the numbers of a vector by blanks alone."
    engines = measured_on("pinocchio", "pybullet")
    changed = "separated the numbers of vectors by blanks instead of tabs and line breaks"
    fault = "tab"
    description = "with a tab, a line break or another blank among its numbers"
