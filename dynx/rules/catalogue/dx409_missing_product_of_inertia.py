"""DX409 missing-product-of-inertia: an ``<inertia>`` has no ``ixy``, ``ixz`` or ``iyz``

Whoever writes a tensor by hand leaves out the products of inertia that are zero. URDF wants all six numbers,
and what engines do without them ranges from nothing to refusing the file.

- Pinocchio 4.1 says on stderr that ``ixy`` is missing and drops the whole tensor: the link is a point mass.
- MuJoCo 4.0 refuses the file and names the line.
- PyBullet 3.2.7 and Drake 1.51 read zero.

The effect is a link without moments of inertia in Pinocchio: of order 0.01 to 1 in the mass matrix.

What to do: write the products that are zero as ``0``. ``dynx doctor --fix`` does so; that a product which is
not there was meant to be zero is the one reading that two engines share. A missing moment (``ixx``, ``iyy``,
``izz``) is not mended: nobody has a zero moment, and the number is not in the file.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import ClassVar

from dynx.rules.case import Case
from dynx.rules.rule import Stage
from dynx.rules.text.editing import Correction, EditingRule, found_at

_MOMENTS = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")


class MissingProductOfInertia(EditingRule):
    """DX409."""

    id = "DX409"
    name = "missing-product-of-inertia"
    title = "A tensor of inertia is written without its zero products."
    stage: ClassVar[Stage] = "reading"
    advice = "Write all six numbers of the tensor."
    engines: ClassVar[Mapping[str, str]] = {"pinocchio": ">=4.1.0", "mujoco": ">=4.0.0"}
    changed = "wrote the products of inertia that were missing as 0"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Tensors with all three moments and not all products."""
        for link in case.source.root.all("link"):
            for inertial in link.all("inertial"):
                for tensor in inertial.all("inertia"):
                    missing = [name for name in _PRODUCTS if name not in tensor.attributes]
                    if missing and all(name in tensor.attributes for name in _MOMENTS):
                        message = f"<inertia> has no {' and no '.join(missing)}"
                        edits = tuple(case.source.setting(tensor, name, "0") for name in missing)
                        yield Correction(found_at(tensor, message), edits)
