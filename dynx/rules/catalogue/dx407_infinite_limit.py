"""DX407 infinite-limit: A limit of a joint is infinite.

``<limit lower="-inf" upper="inf" effort="inf" velocity="inf"/>`` is understandable, but URDF has no notation
for infinity, and engines differ in reading one.

- Pinocchio 4.1 and Drake 1.51 refuse the file.
- PyBullet 3.2.7 and MuJoCo 4.0 read an infinity; MuJoCo refuses ``1e999``.

dynx refuses it too, because half of the engines do.

What to do: omit the limit where that is allowed (``type="continuous"`` needs no lower and no upper), or write
a number that no joint reaches. ``dynx doctor --fix`` writes the largest double, 1.7976931348623157e+308,
which all four engines read and which dynx reads as "no limit". Infinite masses, inertias and positions have
no such substitute, see DX420.
"""

from dynx.rules import measured_on
from dynx.rules.numbers_in_text import MisspelledNumberRule


class InfiniteLimit(MisspelledNumberRule):
    advice = "Write a large finite number, or omit the limit."
    engines = measured_on("pinocchio", "drake")
    unambiguous = True
    changed = "wrote the largest double for infinite limits"
    fault = "infinite"
    description = "which is no finite number"
    elements = ("limit",)
