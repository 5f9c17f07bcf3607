"""DX104 negative-principal-moment: The inertia tensor has a negative principal moment, which no body can
have.

A moment of inertia is a sum of masses times squared distances and cannot be negative. A tensor with a
negative principal moment mostly comes from the theorem of Steiner applied in the wrong direction or twice,
or from products of inertia too large for the moments (a misplaced decimal point, mixed units, a swapped
pair of numbers). The diagonal may look perfectly harmless.

- PyBullet 3.2.7 prints "Bad inertia tensor properties" and takes ZERO for the whole tensor.
- MuJoCo 4.0.0 refuses the file ("inertia must have positive eigenvalues"), for links that cannot move too.
- Drake 1.51.1 warns and takes a ball of the same mass and the density of water in its place.
- Pinocchio 4.1.0 calculates with the numbers as they stand, and so does dynx. The mass matrix may then have
  a negative eigenvalue, and a simulation gains energy from nothing.

What to do: find the true tensor. No engine can be right with this one.

``dynx doctor --fix`` first looks at the links that are welded to this one: often the sum is a body, and then
the inertia is lumped, which changes no equation of motion. Otherwise the tensor nearest to the one in the
file that a body can have takes its place, and the report says that the physics changed. Choose otherwise
with ``--choose DX104=nearest`` (never lump) or ``--choose DX104=keep``: the numbers stay, and the report
prints the lines that give them to PyBullet and Drake after loading. Where PyBullet's inverse dynamics refuses
them all the same, its answers are extrapolated from those for two robots that it takes. MuJoCo cannot follow.
"""

from dynx.rules.inertia.impossible import ImpossibleInertia


class NegativePrincipalMoment(ImpossibleInertia):
    fault = "negative"
