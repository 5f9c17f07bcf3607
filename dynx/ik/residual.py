"""Error between a frame and its target, in plain floats.

Array code does not pay for one sample of six numbers: this arithmetic on floats takes a third of the time of
its NumPy equivalent. It is evaluated at every step of the solver.
"""

from __future__ import annotations

import math

from dynx.spatial.scalar import Floats

Triple = tuple[float, float, float]


class Residual:
    """Error from a frame to one target: position [m], then rotation vector [rad], in world axes.

    A part of the target that is None is free: it has no rows.
    """

    __slots__ = ("_point", "_position", "_rotation", "rows")

    def __init__(self, position: Floats | None, rotation: Floats | None, point: Floats | None) -> None:
        x, y, z = (0.0, 0.0, 0.0) if position is None else position.tolist()
        self._position: Triple | None = None if position is None else (x, y, z)
        self._rotation = rotation
        self._point = point
        self.rows = slice(3 if position is None else 0, 3 if rotation is None else 6)
        """Rows of the Jacobian that change the error."""

    def __call__(self, T_world_frame: Floats) -> tuple[tuple[float, ...], float, float]:
        """Return (residual (6,), or (3,) if a part is free; position error [m]; rotation error [rad])."""
        rx = ry = rz = angle = 0.0
        if self._rotation is not None:
            rx, ry, rz, angle = rotation_vector(self._rotation.dot(T_world_frame[:3, :3].T))
        if self._position is None:
            return (rx, ry, rz), 0.0, angle
        if self._point is None:
            px, py, pz, _ = T_world_frame[:, 3].tolist()
        else:
            px, py, pz = (T_world_frame[:3, :3].dot(self._point) + T_world_frame[:3, 3]).tolist()
        x, y, z = self._position
        x, y, z = x - px, y - py, z - pz
        distance = math.sqrt(x * x + y * y + z * z)
        if self._rotation is None:
            return (x, y, z), distance, 0.0
        return (x, y, z, rx, ry, rz), distance, angle


def rotation_vector(R: Floats) -> tuple[float, float, float, float]:
    """Return the rotation vector of R (3, 3) and its norm in [0, pi] [rad] (Siciliano et al., eq. 2.27)."""
    (r00, r01, r02), (r10, r11, r12), (r20, r21, r22) = R.tolist()
    x, y, z = r21 - r12, r02 - r20, r10 - r01
    twice_sine = math.sqrt(x * x + y * y + z * z)
    twice_cosine = r00 + r11 + r22 - 1.0
    angle = math.atan2(twice_sine, twice_cosine)
    if twice_sine > 1e-7:
        scale = angle / twice_sine
    elif twice_cosine > 0.0:
        scale = 0.5
    else:
        # At an angle of pi the antisymmetric part vanishes: R + 1 = 2 a a'.
        a, b, c = max(
            (r00 + 1.0, r10, r20), (r01, r11 + 1.0, r21), (r02, r12, r22 + 1.0), key=_squared_length
        )
        scale = angle / math.sqrt(_squared_length((a, b, c)))
        x, y, z = a, b, c
    return x * scale, y * scale, z * scale, angle


def _squared_length(a: Triple) -> float:
    return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
