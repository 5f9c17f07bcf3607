"""DX421 minus-not-ascii: A number has a minus sign or a dash of typography instead of the hyphen-minus.

Text that was copied from a document or a web page has the minus sign U+2212 or a dash in front of negative
numbers. It looks like ``-``, and no engine knows it.

- Pinocchio 4.1 refuses the file where the number is in a ``<joint>``; in an ``<inertial>`` it drops the whole
  inertial, or the tensor, with a line on stderr.
- PyBullet 3.2.7 reads 0, without a warning.
- MuJoCo 4.0 and Drake 1.51 refuse the file.

The effect is that of a number that became 0: of order 1 for a position, and a range that ends at 0 for a
limit.

What to do: write the hyphen-minus of the keyboard. ``dynx doctor --fix`` does so, and changes no digit.
"""

from dynx.rules import EVERY_ENGINE
from dynx.rules.numbers_in_text import MisspelledNumberRule


class MinusNotAscii(MisspelledNumberRule):
    advice = "Write the hyphen-minus of the keyboard."
    engines = EVERY_ENGINE
    changed = "wrote the hyphen-minus in numbers"
    fault = "minus"
    description = "in which the minus sign is not the hyphen-minus of {meant}"
