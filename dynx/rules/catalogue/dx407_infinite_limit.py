"""DX407 infinite-limit: A limit of a joint is infinite.

``<limit lower="-inf" upper="inf" effort="inf" velocity="inf"/>`` says what is meant, but URDF has no word
for infinity, and what is no number to one engine is one to another.

- Pinocchio 4.1 and Drake 1.51 refuse the file.
- PyBullet 3.2.7 and MuJoCo 4.0 read an infinity; MuJoCo refuses ``1e999``.

dynx refuses it too, because a file that half of the engines refuse is of no use.

What to do: leave the limit away where that is allowed (``type="continuous"`` needs no lower and no upper),
or write a number that no joint reaches. ``dynx doctor --fix`` writes the largest double,
1.7976931348623157e+308, which all four engines read and which dynx reads as "no limit". Infinite masses,
inertias and positions have no such substitute and stay an error.
"""

from dynx.rules import measured_on
from dynx.rules.text.misspelled_numbers import MisspelledNumberRule


class InfiniteLimit(MisspelledNumberRule):
    advice = "Write a large finite number, or leave the limit away."
    engines = measured_on("pinocchio", "drake")
    changed = "wrote the largest double in place of infinite limits"
    fault = "infinite"
    description = "which is no finite number"
    elements = ("limit",)
