"""A URDF file as PyBullet loads it, with the flag that makes it read the file's inertias.

What a careful user gets right by knowing Bullet's conventions is got right here: its world is the
inertial frame of the root (centre of mass, principal axes) for inverse dynamics, mass matrix and
Jacobian of a free base; columns are angular before linear; the pose of a link is composed from the
double-precision pose of its inertial frame; gravity is turned instead of the base. The frames are
those that Bullet itself reports, never those of the file.

What loading did to the robot shows: masses and inertias that are not those of the file, a base that
stays in place because its root has no mass, axes that are not of unit length, damping and limits that
act in a step; and for a fixed base, that inverse dynamics and the Jacobian take the axes of the root's
inertial frame for those of the world, since nothing that such a user does tells Bullet otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import ClassVar

import numpy as np

from dynx.engines.pybullet import settings as bullet_settings
from dynx.engines.pybullet.file_checks import require_harmless
from dynx.engines.pybullet.library import bullet
from dynx.engines.pybullet.loaded_client import ROOT, BulletWorld
from dynx.engines.pybullet.loaded_description import describe
from dynx.engines.pybullet.settings import CALLS, set_inertias
from dynx.errors import EngineError, shown
from dynx.loaded.description import LoadedModel
from dynx.loaded.robot import LoadedRobot, lacking_joints
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat, skew


class LoadedPyBullet(LoadedRobot):
    """A robot as PyBullet loads it; see `LoadedRobot` and the head of this file."""

    name: ClassVar[str] = "pybullet"
    CALLS: ClassVar[Mapping[str, str]] = CALLS

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        engine = bullet()
        require_harmless(path, model)
        self._model = model
        self._worlds = [BulletWorld(engine, path, model.name, fixed=not model.floating)]
        try:
            self._prepare(calls)
            if self._world.refused and "pybullet.extrapolate_inertias" in calls:
                for times in (1, 2):
                    other = BulletWorld(engine, path, model.name, fixed=not model.floating)
                    self._worlds.append(other)
                    self._set(other, calls)
                    other.apply(bullet_settings.with_ballast(times))
                    other.make_tree()
        except BaseException:
            self.close()
            raise

    def _prepare(self, calls: Collection[str]) -> None:
        model, world = self._model, self._world
        root = world.ask(world.engine.getBodyInfo, world.body)[0]
        children = {_text(info[12]): k for k, info in enumerate(world.joints)}
        self._links = {_text(root): ROOT, **children}
        if model.floating and world.static:
            raise EngineError(
                f"pybullet nails {model.name} to the world: there its root {shown(model.root)} has no mass"
            )
        self._order = self._find_joints()
        self._set(world, calls)
        # Last: inertias that are set after the first inverse dynamics would be ignored.
        world.make_tree()
        # Which links of the model Bullet has, their numbers there, and where they are in its frames.
        self._held = [k for k, link in enumerate(model.links) if link.name in self._links]
        self._numbers = [self._links[model.links[k].name] for k in self._held]
        frames = [inverse(world.com_frame(number)) for number in self._numbers]
        self._T_com_link = np.array(frames).reshape(-1, 4, 4)
        self._T_base_C = world.com_frame(ROOT)
        axes, center = self._T_base_C[:3, :3], self._T_base_C[:3, 3]
        # (angular, linear) of the root's inertial frame from (linear, angular) of the base frame.
        self._X = np.zeros((6, 6))
        self._X[:3, 3:] = self._X[3:, :3] = axes.T
        self._X[3:, 3:] = -axes.T @ skew(center)
        self._X_inverse = np.zeros((6, 6))
        self._X_inverse[3:, :3] = self._X_inverse[:3, 3:] = axes
        self._X_inverse[:3, :3] = skew(center) @ axes

    def _set(self, world: BulletWorld, calls: Collection[str]) -> None:
        world.apply(bullet_settings.simulation_off)
        if "pybullet.set_inertias" in calls:
            world.apply(set_inertias(self._model, self._links))
        if "pybullet.no_damping" in calls:
            world.apply(bullet_settings.no_damping)
        if "pybullet.no_limits" in calls:
            world.apply(bullet_settings.no_limits)

    @property
    def _world(self) -> BulletWorld:
        """The robot as it was loaded."""
        return self._worlds[0]

    @classmethod
    def engine_version(cls) -> str:
        """The version of the distribution, such as ``3.2.7``."""
        bullet()
        try:
            return version("pybullet")
        except PackageNotFoundError:
            return "unknown"

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """One line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return f"robot = p.loadURDF(path, useFixedBase={not floating}, flags=p.URDF_USE_INERTIA_FROM_FILE)"

    def describe(self) -> LoadedModel:
        """From `getDynamicsInfo` and `getJointInfo`."""
        base = self.link_poses(self._model.neutral())[0]
        return describe(self._world, self._model, self._links, base)

    def close(self) -> None:
        """Disconnect the client, or clients."""
        for world in self._worlds:
            world.close()

    # -- answers ------------------------------------------------------------------------------

    def link_poses(self, q: Floats) -> Floats:
        """Composed from the poses of the inertial frames."""
        world = self._world
        if self._model.floating:
            T_world_C = homogeneous(rotation_from_quat(q[3:7]), q[:3]) @ self._T_base_C
            quat = quat_from_rotation(T_world_C[:3, :3])
            world.place_base(T_world_C[:3, 3].tolist(), quat.tolist())
        positions, quats = world.com_poses(self._joints(q))
        position, quat = map(np.array, world.base_pose())
        # The root comes last, so that its number -1 finds it.
        T_world_com = homogeneous(
            rotation_from_quat(np.concatenate([quats, quat[None]])),
            np.concatenate([positions, position[None]]),
        )
        T = np.full((len(self._model.links), 4, 4), np.nan)
        T[self._held] = T_world_com[self._numbers] @ self._T_com_link
        return T

    def jacobian(self, q: Floats, link: str) -> Floats:
        """`calculateJacobian` at the origin of the link frame.

        That call wants a joint that moves; of the root, and of a robot without such a joint, the
        Jacobian follows from the poses.
        """
        model = self._model
        base = 6 if model.floating else 0
        if link not in self._links:
            return np.full((6, model.nv), np.nan)
        if self._links[link] == ROOT or not self._world.moving:
            return self._carried(q, link)
        J_C = self._worlds[-1].jacobian(self._joints(q), self._links[link])
        J = np.zeros((6, model.nv))
        J[:, base:] = J_C[:, base:][:, self._order]
        if base:
            J[:, :6] = J_C[:, :6] @ self._X
            R_world_C = rotation_from_quat(q[3:7]) @ self._T_base_C[:3, :3]
            J = np.concatenate([R_world_C @ J[:3], R_world_C @ J[3:]])
        return J

    def _carried(self, q: Floats, link: str) -> Floats:
        """The Jacobian of a link that the base alone moves."""
        J = np.zeros((6, self._model.nv))
        if self._model.floating:
            R = rotation_from_quat(q[3:7])
            place = [each.name for each in self._model.links].index(link)
            arm = self.link_poses(q)[place, :3, 3] - q[:3]
            J[:3, :3] = J[3:, 3:6] = R
            J[:3, 3:6] = -skew(arm) @ R
        return J

    def mass_matrix(self, q: Floats) -> Floats:
        """`calculateMassMatrix`."""
        if not self._coordinates:
            return np.zeros((0, 0))
        M = self._extrapolated(lambda world: world.mass_matrix(self._joints(q)))
        base = 6 if self._model.floating else 0
        kept = [*range(base), *(base + k for k in self._order)]
        M = M[np.ix_(kept, kept)]
        if base:
            M[:6] = self._X.T @ M[:6]
            M[:, :6] = M[:, :6] @ self._X
        return M

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """`calculateInverseDynamics`."""
        if not self._coordinates:
            return np.zeros(0)
        if not self._model.floating:
            gravity = list(self._model.gravity)
            x = self._joints(q), self._spread(v), self._spread(a), gravity
            return self._extrapolated(lambda world: world.inverse_dynamics(*x))[self._order]
        v_C, a_C = self._X @ v[:6], self._X @ a[:6]
        # dv/dt in turning axes to the classical acceleration of the centre of mass.
        a_C[3:] += cross(v_C[:3], v_C[3:])
        x = (
            self._joints(q),
            [*v_C.tolist(), *self._spread(v[6:])],
            [*a_C.tolist(), *self._spread(a[6:])],
            self._gravity_in_C(q),
        )
        tau = self._extrapolated(lambda world: world.inverse_dynamics(*x))
        # Bullet answers with the force first.
        wrench = self._X.T @ np.concatenate([tau[3:6], tau[:3]])
        return np.concatenate([wrench, tau[6:][self._order]])

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """What one step of unit length adds to the velocity.

        Where a joint that the model lacks is held, solved from mass matrix and inverse dynamics.
        """
        if not self._coordinates:
            return np.zeros(0)
        if len(self._order) < len(self._world.moving):
            return self._solved_acceleration(q, v, tau)
        if not self._model.floating:
            gravity = list(self._model.gravity)
            step = self._world.velocity_step(self._joints(q), self._spread(v), self._spread(tau), gravity)
            return step[self._order]
        v_C, tau_C = self._X @ v[:6], self._X_inverse.T @ tau[:6]
        step = self._world.velocity_step(
            self._joints(q),
            [*v_C.tolist(), *self._spread(v[6:])],
            [*tau_C.tolist(), *self._spread(tau[6:])],
            self._gravity_in_C(q),
        )
        step[3:6] -= cross(v_C[:3], v_C[3:])
        return np.concatenate([self._X_inverse @ step[:6], step[6:][self._order]])

    # -- coordinates --------------------------------------------------------------------------

    def _find_joints(self) -> list[int]:
        """For each coordinate of dynx, its place among the coordinates of Bullet."""
        engine, world = self._world.engine, self._world
        single = {engine.JOINT_REVOLUTE, engine.JOINT_PRISMATIC}
        kinds = {_text(info[1]): info[2] for info in world.joints}
        names = self._model.joint_names
        missing = [name for name in names if kinds.get(name) not in single]
        missing += [name for name, kind in kinds.items() if kind not in {*single, engine.JOINT_FIXED}]
        if missing:
            words = {engine.JOINT_SPHERICAL: "spherical", engine.JOINT_PLANAR: "planar"}
            words[engine.JOINT_FIXED] = "fixed"
            instead = {name: words.get(kinds.get(name), "not there") for name in missing}
            raise lacking_joints(self.name, self._model, instead)
        place = {_text(world.joints[k][1]): n for n, k in enumerate(world.moving)}
        return [place[name] for name in names]

    @property
    def _coordinates(self) -> bool:
        """Whether there is any: without, Bullet answers with None or an empty tuple."""
        return bool(self._world.moving) or self._model.floating

    def _extrapolated(self, answer: Callable[[BulletWorld], Floats]) -> Floats:
        if len(self._worlds) == 1:
            return answer(self._world)
        return 2.0 * answer(self._worlds[1]) - answer(self._worlds[2])

    def _joints(self, q: Floats) -> list[float]:
        return self._spread(q[7 if self._model.floating else 0 :])

    def _spread(self, values: Floats) -> list[float]:
        """Values of dynx's joints, as many as it has of the last entries, among those of Bullet."""
        n = len(self._order)
        x = [0.0] * len(self._world.moving)
        for place, value in zip(self._order, values[len(values) - n :].tolist(), strict=True):
            x[place] = value
        return x

    def _gravity_in_C(self, q: Floats) -> list[float]:
        R_world_C = rotation_from_quat(q[3:7]) @ self._T_base_C[:3, :3]
        gravity: list[float] = (R_world_C.T @ np.array(self._model.gravity)).tolist()
        return gravity


def _text(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape")
