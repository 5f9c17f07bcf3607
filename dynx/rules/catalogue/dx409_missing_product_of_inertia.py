"""DX409 missing-product-of-inertia: An inertia tensor is written without its zero products.

Tensors written by hand often omit the products of inertia that are zero. URDF requires all six numbers; some
engines accept fewer, some refuse the file.

- Pinocchio 4.1 prints on stderr that ``ixy`` is missing and drops the whole tensor: the link is a point mass.
- MuJoCo 4.0 refuses the file and names the line.
- PyBullet 3.2.7 and Drake 1.51 read zero.

The effect is a link without moments of inertia in Pinocchio: of order 0.01 to 1 in the mass matrix.

What to do: write the products that are zero as ``0``. ``dynx doctor --fix`` does so; two engines read a
missing product as zero. A number under a misspelled name, ``iyx="0.01"``, is what was meant, and gets the
right name. A missing moment (``ixx``, ``iyy``, ``izz``) is DX410: no body has a zero moment, and
the file does not contain the number.
"""

from collections.abc import Iterable

from dynx.rules import Case, Correction, EditingRule, measured_on
from dynx.rules.attributes import completion

_MOMENTS = ("ixx", "iyy", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")


class MissingProductOfInertia(EditingRule):
    stage = "reading"
    advice = "Write all six numbers of the tensor."
    engines = measured_on("pinocchio", "mujoco")
    unambiguous = True
    changed = "wrote the products of inertia that were missing as 0"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield tensors with all three moments and not all products."""
        for link in case.source.root.all("link"):
            for inertial in link.all("inertial"):
                for tensor in inertial.all("inertia"):
                    missing = [name for name in _PRODUCTS if name not in tensor.attributes]
                    if missing and all(name in tensor.attributes for name in _MOMENTS):
                        message = f"<inertia> has no {' and no '.join(missing)}"
                        yield completion(case, tensor, message, missing, "0")
