"""Order of the coordinates of an engine that loads the file of a robot itself, beside that of dynx.

`dynx.backends` hides the coordinates of engines. Who calls an engine directly, or reads its logs, needs them.
Engines list joints in an order of their own, and have joints that a model of dynx has not, because they are
locked or follow others. They also write a floating base differently:

| engine | position of the base | its velocity | angle without limits |
|---|---|---|---|
| `mujoco` | x, y, z, then w, x, y, z | linear in axes of the world, angular of the base | the angle |
| `pinocchio` | x, y, z, then x, y, z, w | linear and angular in axes of the base | its cosine and sine |
| `drake` | w, x, y, z, then x, y, z | angular before linear, in axes of the world | the angle |
| `pybullet` | x, y, z, then x, y, z, w | linear and angular in axes of the world | the angle |

MuJoCo has the quaternion of a ball joint as w, x, y, z, and its velocity in the axes of the child, as dynx.
The other engines refuse robots with ball joints here; Drake has three angles instead of a quaternion.

PyBullet has no vectors q and v. Here they are what `getBasePositionAndOrientation` and `getBaseVelocity`
return, if the base floats, and then the joints that are not fixed, in the order of `getJointInfo`. The base
of PyBullet is the inertial frame of the root link.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, EngineError, UnsupportedFeatureError, shown
from dynx.files.reading import read_file
from dynx.files.temporary import temporary_folder
from dynx.loaded.registry import load_as
from dynx.loaded.robot import EngineCoordinates
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.loading import load
from dynx.model.numbers import checked_array
from dynx.model.xml.source import XmlSource
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import cross, quat_from_rotation, rotate, rotate_back, rotation_from_quat

_SHAPES = ("visual", "collision")
"""Elements of URDF with the shapes of a link."""


@dataclass(frozen=True, eq=False)
class EngineOrder:
    """Order of the q and v of an engine for a robot, and the conversions from and to those of dynx.

    The conversions do more than change the order. They fill joints that follow others or are locked, and
    express the velocity of a floating base in the axes of the engine. Entries of the engine for which the
    file has no joint are neutral. Arrays may have leading axes, which broadcast.
    """

    engine: str
    model: Model
    coordinates: EngineCoordinates
    """Coordinates of all joints of the file that move, also of those that are locked in the model or follow
    others."""
    joint_names: tuple[str, ...]
    """Names of these joints."""

    @cached_property
    def positions(self) -> Array:
        """Index (nq,) in the engine's q of each entry of dynx's q. If the engine has the cosine and sine of
        an angle, this is the index of the cosine."""
        base = self.coordinates.base
        own = [self.coordinates.joints_q[k] for k in self._own("q")]
        return np.array([*(() if base is None else base.q), *own], dtype=np.intp)

    @cached_property
    def velocities(self) -> Array:
        """Index (nv,) in the engine's v of each entry of dynx's v."""
        base = self.coordinates.base
        own = [self.coordinates.joints_v[k] for k in self._own("v")]
        return np.array([*(() if base is None else base.v), *own], dtype=np.intp)

    def from_dynx(self, q: ArrayLike) -> Floats:
        """Return the engine's q (..., n) at a configuration `q` (..., nq) of dynx."""
        q = checked_q(self.model, q)
        source, scale, offset = self._position_couplings
        coordinates = self.coordinates
        joints = _padded(q)[..., source] * scale + offset
        out = np.empty((*q.shape[:-1], len(coordinates.neutral)))
        out[...] = coordinates.neutral
        for k, (at, is_circle) in enumerate(zip(coordinates.joints_q, coordinates.circles, strict=True)):
            if is_circle:
                out[..., at], out[..., at + 1] = np.cos(joints[..., k]), np.sin(joints[..., k])
            else:
                out[..., at] = joints[..., k]
        base = coordinates.base
        if base is not None:
            out[..., list(base.q)] = _moved(q[..., :7], base.T_base_frame)
        return out

    def to_dynx(self, q: ArrayLike) -> Floats:
        """Return the configuration (..., nq) of dynx at the engine's `q` (..., n).

        Angles that the engine has as cosine and sine are in [-pi, pi].
        """
        coordinates = self.coordinates
        q = checked_array("q", q, len(coordinates.neutral))
        out = q[..., self.positions]
        own = self._own("q")
        for k, number in enumerate(own, self.model.nq - len(own)):
            if coordinates.circles[number]:
                at = coordinates.joints_q[number]
                out[..., k] = np.arctan2(q[..., at + 1], q[..., at])
        if coordinates.base is not None:
            out[..., :7] = _moved(out[..., :7], inverse(coordinates.base.T_base_frame))
        return out

    def velocity_from_dynx(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Return the engine's v (..., n) at `q` (..., nq) and `v` (..., nv) of dynx."""
        q, v = checked_q(self.model, q), checked_array("v", v, self.model.nv)
        source, scale, _ = self._rate_couplings
        base = self.coordinates.base
        joints = _padded(v)[..., source] * scale
        shape = np.broadcast_shapes(q.shape[:-1], v.shape[:-1])
        out = np.zeros((*shape, self.coordinates.n_velocities))
        out[..., list(self.coordinates.joints_v)] = joints
        if base is not None:
            R, linear, angular = rotation_from_quat(q[..., 3:7]), v[..., :3], v[..., 3:6]
            linear = linear + cross(angular, np.broadcast_to(base.T_base_frame[:3, 3], angular.shape))
            out[..., list(base.v[:3])] = rotate(R, linear) if base.linear_in_world else linear
            out[..., list(base.v[3:])] = rotate(R, angular) if base.angular_in_world else angular
        return out

    def velocity_to_dynx(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Return the velocity (..., nv) of dynx at the engine's `q` (..., n) and `v` (..., m)."""
        q, v = self.to_dynx(q), checked_array("v", v, self.coordinates.n_velocities)
        shape = np.broadcast_shapes(q.shape[:-1], v.shape[:-1])
        out: Floats = np.broadcast_to(v[..., self.velocities], (*shape, self.model.nv)).copy()
        base = self.coordinates.base
        if base is not None:
            R, linear, angular = rotation_from_quat(q[..., 3:7]), out[..., :3], out[..., 3:6]
            angular = rotate_back(R, angular) if base.angular_in_world else angular
            linear = rotate_back(R, linear) if base.linear_in_world else linear
            out[..., 3:6] = angular
            out[..., :3] = linear - cross(angular, np.broadcast_to(base.T_base_frame[:3, 3], angular.shape))
        return out

    def _own(self, of: Literal["q", "v"]) -> list[int]:
        """Return the numbers, among the entries of all joints in q or in v, of those that the model has, in
        its order."""
        first: dict[str, int] = {}
        count = 0
        for name in self.joint_names:
            first[name] = count
            count += self._entries(name, of)
        return [first[name] + k for name in self.model.joint_names for k in range(self._entries(name, of))]

    def _entries(self, name: str, of: Literal["q", "v"]) -> int:
        """Return the number of entries of a joint, of those that the file has move: four or three of a ball
        joint."""
        is_ball = self.model.joint(name).type == "ball"
        return (4 if of == "q" else 3) if is_ball else 1

    @cached_property
    def _position_couplings(self) -> tuple[Array, Floats, Floats]:
        return self._couplings("q")

    @cached_property
    def _rate_couplings(self) -> tuple[Array, Floats, Floats]:
        return self._couplings("v")

    def _couplings(self, of: Literal["q", "v"]) -> tuple[Array, Floats, Floats]:
        """Return index in dynx's q or v, scale and offset, from which each entry of the joints follows.

        The index -1 is that of `_padded`, for locked joints.
        """
        index = self.model.position_index if of == "q" else self.model.coordinate_index
        rows = []
        for name in self.joint_names:
            joint = self.model.joint(name)
            if joint.mimic is not None:
                multiplier = joint.mimic.multiplier
                driver = index(joint.mimic.joint) if of == "q" or multiplier else -1
                rows.append((driver, multiplier, joint.mimic.offset))
            elif joint.moves:
                rows += [(index(name) + k, 1.0, 0.0) for k in range(self._entries(name, of))]
            else:
                rows.append((-1, 0.0, joint.locked_at or 0.0))
        source, scale, offset = zip(*rows, strict=True) if rows else ((), (), ())
        return np.array(source, dtype=np.intp), np.array(scale, dtype=float), np.array(offset, dtype=float)


@checks_types
def order_of(model: Model, engine: str) -> EngineOrder:
    """Return the order of the q and v of an engine that loads the file of a model itself.

    Raises ArgumentError for a model that is not from a file, or whose base is not that of its file;
    UnsupportedFeatureError for joints that the order cannot express, and the errors of `load_as`.
    """
    path = Path(model.source)
    if not path.is_file():
        raise ArgumentError(
            f"{model.name} is from {shown(model.source)}, and an engine has an order once it loads a file; "
            "wanted a model that dynx.load read from a file"
        )
    stated = load(path, base=model.base) if path.suffix == ".urdf" else load(path)
    if stated.base != model.base:
        raise ArgumentError(f"the base of {model.name} is {model.base}, and that of its file {stated.base}")
    for joint in stated.joints:
        if joint.locked_at is not None:
            raise UnsupportedFeatureError(
                f"{shown(joint.name)} of {model.name} follows a joint that does not move; an engine has a "
                "coordinate of it, and dynx has none",
                source=model.source,
                line=joint.line,
            )
    free = replace(stated, joints=tuple(replace(joint, mimic=None) for joint in stated.joints))
    try:
        return _order(engine, path, model, free)
    except EngineError:
        # Such as a mesh that the engine does not find: no shape of URDF has a coordinate.
        text = None if path.suffix != ".urdf" else _without_shapes(path)
        if text is None:
            raise
        with temporary_folder() as folder:
            bare = Path(folder) / path.name
            bare.write_bytes(text)
            return _order(engine, bare, model, free)


def _order(engine: str, path: Path, model: Model, free: Model) -> EngineOrder:
    with load_as(engine, path, free) as robot:
        return EngineOrder(engine, model, robot.coordinates(), free.joint_names)


def _without_shapes(path: Path) -> bytes | None:
    """Return the text of a URDF file without its shapes; None for one without shapes."""
    source = XmlSource(read_file(str(path)), str(path))
    shapes = [shape for link in source.root.all("link") for tag in _SHAPES for shape in link.all(tag)]
    return source.apply(*map(source.removal, shapes)).to_bytes() if shapes else None


def _padded(x: Floats) -> Floats:
    """Return an array with one more entry, which is 0."""
    return np.concatenate([x, np.zeros((*x.shape[:-1], 1))], axis=-1)


def _moved(base: Floats, T: Floats) -> Floats:
    """Return the position and quaternion (..., 7) of a frame that is at T (4, 4) in that of `base`."""
    if (np.eye(4) == T).all():
        return base
    moved = homogeneous(rotation_from_quat(base[..., 3:7]), base[..., :3]) @ T
    return np.concatenate([moved[..., :3, 3], quat_from_rotation(moved[..., :3, :3])], axis=-1)
