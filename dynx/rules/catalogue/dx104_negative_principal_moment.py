"""DX104 negative-principal-moment: The inertia tensor has a negative principal moment, which no body can
have.

A moment of inertia is a sum of masses times squared distances and cannot be negative. A tensor with a
negative principal moment mostly comes from the parallel axis theorem applied in the wrong direction or twice,
or from products of inertia too large for the moments (a misplaced decimal point, mixed units, a swapped pair
of numbers). The diagonal may look correct.

- PyBullet 3.2.7 prints "Bad inertia tensor properties" and replaces the whole tensor by ZERO.
- MuJoCo 4.0.0 refuses the file ("inertia must have positive eigenvalues"), for links that cannot move too.
- Drake 1.51.1 warns and replaces it by the tensor of a ball of the same mass and the density of water.
- Pinocchio 4.1.0 uses the numbers unchanged, as dynx does. The mass matrix may then have a negative
  eigenvalue, and a simulation gains energy without a source.

What to do: find the true tensor. No engine can be right with this tensor.

``dynx doctor --fix`` first tries the links rigidly connected to this one: often their sum is a possible body,
and then the inertias are merged, which changes no equation of motion. Otherwise the nearest tensor that a
body can have replaces it, and the report says that the physics changed. Choose otherwise with
``--choose DX104=nearest`` (never merge) or ``--choose DX104=keep``: the numbers stay, and the report prints
the lines that give them to PyBullet and Drake after loading. Where PyBullet's inverse dynamics refuses them
even so, its results are extrapolated from those of two robots that it accepts. MuJoCo cannot use these
numbers.
"""

from dynx.rules.inertia import ImpossibleInertia


class NegativePrincipalMoment(ImpossibleInertia):
    fault = "negative"
