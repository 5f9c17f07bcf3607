"""DX402 comma-between-numbers: The numbers of a vector are parted by commas in place of blanks.

URDF parts the numbers of a vector by blanks. Commas or semicolons are what other formats use.

- Pinocchio 4.1 refuses the file where the vector is in a ``<joint>``; in an ``<inertial>`` it drops the
  whole inertial with a line on stderr, so the link weighs nothing.
- PyBullet 3.2.7 reads ``1, 2, 3`` as meant, because it reads each word up to where it stops being a
  number. Without blanks, ``1,2,3``, it finds one word where it wants three, prints a warning and uses
  zeros: a joint sits at its parent's origin.
- MuJoCo 4.0 and Drake 1.51 refuse the file.

The effect is that of a missing offset or rotation: of order 1 in the positions of all links behind it. Of
the files that come with PyBullet, ``bicycle/bike.urdf`` has such a vector.

What to do: part numbers by blanks. ``dynx doctor --fix`` does so. ``0,2 0,5 0,1`` is something else: there
the commas stand for decimal points, see DX401.
"""

from dynx.rules import EVERY_ENGINE
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule


class CommaBetweenNumbers(MisspelledNumberRule):
    advice = "Part the numbers of a vector by blanks alone."
    engines = EVERY_ENGINE
    changed = "parted the numbers of vectors by blanks in place of commas"
    fault = "separator"
    description = "with commas or semicolons between the numbers {meant}"
