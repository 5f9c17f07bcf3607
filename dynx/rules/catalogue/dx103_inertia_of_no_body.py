"""DX103 inertia-of-no-body: A principal moment of inertia exceeds the sum of the other two, which no body can
have.

Each principal moment of a body is the sum of two of three second moments of mass, so none can exceed the
sum of the other two. A tensor that breaks this by more than rounding was mistyped, given in mixed units, or
taken about different points. ``ixx`` to ``izz`` all 1e-6, products included, is a common one.

- PyBullet 3.2.7 prints "Bad inertia tensor properties" and takes ZERO for the whole tensor.
- MuJoCo 4.0.0 refuses the file ("inertia must satisfy A + B >= C"), for links that cannot move too.
- Drake 1.51.1 warns and takes a ball of the same mass and the density of water in its place.
- Pinocchio 4.1.0 calculates with the numbers as they stand, and so does dynx.

Four engines, three different robots. On public robots the mass matrix is off by 6e-6 (a finger) to 4 %
(a sensor mount), the accelerations by up to 40 %.

What to do: find the true tensor. No engine can be right with this one.

``dynx doctor --fix`` first looks at the links that are welded to this one: often the sum is a body, and then
the inertia is lumped, which changes no equation of motion. Otherwise the tensor nearest to the one in the
file that a body can have takes its place, and the report says that the physics changed. Choose otherwise
with ``--choose DX103=nearest`` (never lump) or ``--choose DX103=keep``: the numbers stay, and the report
prints the lines that give them to PyBullet and Drake after loading; MuJoCo then cannot follow.
"""

from dynx.rules.inertia.impossible import ImpossibleInertia


class InertiaOfNoBody(ImpossibleInertia):
    fault = "triangle"
