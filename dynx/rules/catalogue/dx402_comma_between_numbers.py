"""DX402 comma-between-numbers: The numbers of a vector are separated by commas instead of blanks.

URDF separates the numbers of a vector by blanks. Other formats use commas or semicolons.

- Pinocchio 4.1 refuses the file where the vector is in a ``<joint>``; in an ``<inertial>`` it drops the whole
  inertial with a line on stderr, so the link weighs nothing.
- PyBullet 3.2.7 reads ``1, 2, 3`` as intended, because it reads the number at the beginning of each word.
  Without blanks, ``1,2,3``, it finds one word instead of three, prints a warning and uses zeros: a joint sits
  at its parent's origin.
- MuJoCo 4.0 and Drake 1.51 refuse the file.

The effect is that of a missing offset or rotation: of order 1 in the positions of all links behind it. Of the
files that come with PyBullet, ``bicycle/bike.urdf`` has such a vector.

What to do: separate numbers by blanks. ``dynx doctor --fix`` does so. In ``0,2 0,5 0,1`` the commas are
decimal points, see DX401.
"""

from dynx.rules import EVERY_ENGINE
from dynx.rules.numbers_in_text import MisspelledNumberRule


class CommaBetweenNumbers(MisspelledNumberRule):
    advice = "Separate the numbers of a vector by blanks alone."
    engines = EVERY_ENGINE
    unambiguous = True
    changed = "separated the numbers of vectors by blanks instead of commas"
    fault = "separator"
    description = "with commas or semicolons between the numbers {meant}"
