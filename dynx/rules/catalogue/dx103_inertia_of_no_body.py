"""DX103 inertia-of-no-body: A principal moment of inertia exceeds the sum of the other two, which no body can
have.

Each principal moment of a body is the sum of two of three second moments of mass, so none can exceed the sum
of the other two. A tensor that breaks this by more than rounding was mistyped, given in mixed units, or taken
about different points. Often all six numbers are 1e-6.

- PyBullet 3.2.7 prints "Bad inertia tensor properties" and replaces the whole tensor by ZERO.
- MuJoCo 4.0.0 refuses the file ("inertia must satisfy A + B >= C"), for links that cannot move too.
- Drake 1.51.1 warns and replaces it by the tensor of a ball of the same mass and the density of water.
- Pinocchio 4.1.0 uses the numbers unchanged, as dynx does.

So four engines have three different robots. On public robots the mass matrix is off by 6e-6 (a finger) to 4 %
(a sensor mount), the accelerations by up to 40 %.

What to do: find the true tensor. No engine can be right with this tensor.

``dynx doctor --fix`` first tries the links rigidly connected to this one: often their sum is a possible body,
and then the inertias are merged, which changes no equation of motion. Otherwise the nearest tensor that a
body can have replaces it, and the report says that the physics changed. Choose otherwise with
``--choose DX103=nearest`` (never merge) or ``--choose DX103=keep``: the numbers stay, and the report prints
the lines that give them to PyBullet and Drake after loading; MuJoCo cannot use these numbers.
"""

from dynx.rules.inertia import ImpossibleInertia


class InertiaOfNoBody(ImpossibleInertia):
    fault = "triangle"
