"""A file as PyBullet loads it: URDF with the flag that makes it read the file's inertias, MJCF, or SDF.

Engine calls respect Bullet's conventions: its world is the inertial frame of the root (centre of mass,
principal axes) for inverse dynamics, mass matrix and Jacobian of a floating base; columns are angular before
linear; the pose of a link is composed from the double-precision pose of its inertial frame; gravity is
rotated instead of the base. The frames are those that Bullet reports, never those of the file.

The effects of loading show in the results: masses and inertias that differ from the file, a base that stays
in place because its root has no mass, axes that are not of unit length, damping and limits that act in a
step. With a fixed base, inverse dynamics and the Jacobian are in the axes of the root's inertial frame
instead of those of the world, because no call changes that.

**Other flags.** By the plain call, without the flag that makes it read inertias, Bullet computes the inertia
of each link from the bounding box of its collision shapes, for the mass of the file: about axes parallel to
those of the inertial, through the centre of mass of the file, wherever the shapes are. A link without shapes
gets an inertia of almost zero.

With the flag that merges links on fixed joints, Bullet sums their inertias about wrong axes.

**Other formats.** ``loadMJCF`` and ``loadSDF`` load every body of a file. The one with the joints of the
model is examined. Bullet calls the root of an MJCF file by a name of its own; where that is fixed, it is
the world.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.argument_types import checks_types
from dynx.engines.pybullet.backend import MAX_RESIDUAL, base_conversion, inverse_base_conversion
from dynx.engines.pybullet.client import ORIGIN, LoadedClient, Setting
from dynx.engines.pybullet.file_checks import require_harmless
from dynx.engines.pybullet.library import bullet
from dynx.errors import UnusableEngineError, shown
from dynx.loaded.robot import (
    EngineBase,
    EngineCoordinates,
    LoadedInertial,
    LoadedJoint,
    LoadedModel,
    LoadedRobot,
    called_joints,
    checked_format,
    lacking_joints,
)
from dynx.model import Model
from dynx.model.document_format import Format
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import cross, quat_from_rotation, rotation_from_quat, skew

CALLS: Mapping[str, str] = {
    "pybullet.set_inertias": (
        "p.changeDynamics(robot, link, localInertiaDiagonal=[ixx, iyy, izz])"
        "  # the principal moments of the file; before the first calculateInverseDynamics"
    ),
    "pybullet.no_damping": (
        "for j in range(p.getNumJoints(robot)): p.changeDynamics(robot, j, jointDamping=0)"
    ),
    "pybullet.no_limits": (
        "for j in range(p.getNumJoints(robot)): "
        "p.changeDynamics(robot, j, jointLowerLimit=-1e300, jointUpperLimit=1e300)"
    ),
    "pybullet.no_contacts": (
        "for k in range(-1, p.getNumJoints(robot)): p.setCollisionFilterGroupMask(robot, k, 0, 0)"
    ),
    "pybullet.extrapolate_inertias": (
        "# load it into two clients; s is larger than any |moment|; k = 1 in the first, 2 in the second\n"
        "p.changeDynamics(robot, link, localInertiaDiagonal=[ixx + k * s, iyy + k * s, izz + k * s])\n"
        "tau = 2 * tau_of_the_first - tau_of_the_second  # likewise the mass matrix"
    ),
}
"""The lines of code, by the id of the remedy."""

STEP_DEFAULTS: Mapping[str, str] = {
    # Set for the root, the damping is that of all links.
    "damps every link by 0.04 per second": "p.changeDynamics(robot, -1, linearDamping=0, angularDamping=0)",
}
"""What ``stepSimulation`` does by itself, besides driving the motors of joints -> the line of code that
switches it off."""

_JOINT_VALUES = {
    "pybullet.no_damping": {"jointDamping": 0.0},
    # Limits that no joint reaches.
    "pybullet.no_limits": {"jointLowerLimit": -1e300, "jointUpperLimit": 1e300},
}
"""The values of joints that a call sets."""


def disable_simulation_settings(client: LoadedClient) -> None:
    """Switch off motors, damping of links and the limit of speeds, which do not come from the file."""
    client.disable_damping()
    client.release_motors()


def disable_contacts(client: LoadedClient) -> None:
    """Let no link of the robot touch anything."""
    for k in (ROOT, *client.links):
        client.call(client.engine.setCollisionFilterGroupMask, client.body, k, 0, 0)


def set_joints(joints: Mapping[str, int], calls: Collection[str]) -> Setting:
    """Return the setting that applies those of `calls` that act on joints, which `joints` numbers by name."""

    def change(client: LoadedClient) -> None:
        for call, values in _JOINT_VALUES.items():
            for name in called_joints(calls, call, joints):
                client.call(client.engine.changeDynamics, client.body, joints[name], **values)

    return change


def set_inertias(model: Model, links: Mapping[str, int], *, restored: bool = True) -> Setting:
    """Return the setting that restores the moments of the file where Bullet replaced them by zero; with
    `restored` false that sets mass and moments of every link, about the axes that Bullet holds."""

    def change(client: LoadedClient) -> None:
        known = {link.name for link in model.links}
        for name, k in links.items():
            if name not in known:
                continue
            inertial = model.inertial(name)
            held = client.dynamics(k)
            if (
                (restored and any(held[2]))
                or not inertial.tensor.any()
                or (k == ROOT and not client.floating)
            ):
                continue
            R = rotation_from_quat(np.array(held[4])).T @ inertial.origin.matrix[:3, :3]
            moments = np.diagonal(R @ inertial.tensor @ R.T).tolist()
            if not restored:
                client.call(client.engine.changeDynamics, client.body, k, mass=inertial.mass)
            client.call(client.engine.changeDynamics, client.body, k, localInertiaDiagonal=moments)

    return change


def with_ballast(times: int) -> Setting:
    """Return the setting that adds `times` times a rotational inertia s, the same about every axis, to each
    impossible inertia.

    Inverse dynamics f and the mass matrix are affine in the inertia of each link, so that
    f(I) = 2 f(I + s) - f(I + 2 s); and with s larger than any moment Bullet accepts the link.
    """

    def change(client: LoadedClient) -> None:
        for k in (ROOT, *client.links):
            moments = client.dynamics(k)[2]
            if (k == ROOT and not client.floating) or _possible(*sorted(moments)):
                continue
            # A power of two, so that adding it loses the fewest digits.
            s = 2.0 ** np.ceil(np.log2(2.0 * max(map(abs, moments))))
            loaded = [float(moment + times * s) for moment in moments]
            client.call(client.engine.changeDynamics, client.body, k, localInertiaDiagonal=loaded)

    return change


def _possible(small: float, middle: float, large: float) -> bool:
    """Check whether a body can have these principal moments, with a margin for the rounding of Bullet."""
    return small >= 0.0 and small + middle >= large * (1.0 + 64.0 * float(np.finfo(float).eps))


def describe_model(client: LoadedClient, model: Model, links: Mapping[str, int], base: Floats) -> LoadedModel:
    """Return the description of a loaded robot.

    `links` maps link names to Bullet's numbers; `base` is the pose of the root link at the neutral q.
    """
    # Bullet's frame of a link is the inertial frame.
    com = {k: client.com_frame(k) for k in links.values()}
    joints = {}
    for k, info in enumerate(client.joints):
        if info[2] == client.engine.JOINT_FIXED:
            continue
        name = info[1].decode("utf-8", "surrogateescape")
        joints[name] = _joint(client.engine, info, com[int(info[16])], com[k])
    return LoadedModel(
        engine="pybullet",
        links={name: _inertial(client.dynamics(k)) for name, k in links.items()},
        joints=joints,
        base_frame=base,
        gravity=np.zeros(3),
        missing_links=tuple(link.name for link in model.links if link.name not in links),
        remarks=tuple(client.messages),
    )


def _inertial(info: Any) -> LoadedInertial:
    R = rotation_from_quat(np.array(info[4]))
    return LoadedInertial(float(info[0]), np.array(info[3]), np.asarray(R @ np.diag(info[2]) @ R.T))


def _joint(engine: Any, info: Any, T_parent_com: Floats, T_child_com: Floats) -> LoadedJoint:
    """Describe a joint from `getJointInfo`: entry 13 is the axis in the inertial frame of the child, 14
    the joint's position in the inertial frame of the parent, and 15 the attitude of the latter in the
    former at value 0."""
    position = T_parent_com[:3, :3] @ np.array(info[14]) + T_parent_com[:3, 3]
    R_child_parent = rotation_from_quat(np.array(info[15]))
    R = T_parent_com[:3, :3] @ R_child_parent.T @ T_child_com[:3, :3].T
    lower, upper = float(info[8]), float(info[9])
    # Bullet has no continuous type: limits in the wrong order mean that there are none.
    limited = lower <= upper
    kinds = {engine.JOINT_PRISMATIC: "prismatic", engine.JOINT_REVOLUTE: "revolute"}
    kind = kinds.get(info[2], str(info[2]))
    return LoadedJoint(
        type="continuous" if kind == "revolute" and not limited else kind,
        placement=homogeneous(R, position),
        axis=T_child_com[:3, :3] @ np.array(info[13]),
        limits=(lower, upper) if limited else (-np.inf, np.inf),
        velocity=float(info[11]),
        effort=float(info[10]),
        damping=float(info[6]),
        friction=float(info[7]),
    )


_UNNAMED = "anonymous"
"""Bullet's name of a body of MJCF that the file gives none, as of a floor."""

_FUNCTIONS: Mapping[Format, str] = {"urdf": "loadURDF", "mjcf": "loadMJCF", "sdf": "loadSDF"}
"""PyBullet's function for each format."""

USE_INERTIA = "URDF_USE_INERTIA_FROM_FILE"
"""Flag that makes PyBullet read the inertias of the file."""


class LoadedPyBullet(LoadedRobot):
    """A robot as PyBullet loads it; see `LoadedRobot` and the module docstring."""

    name: ClassVar[str] = "pybullet"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf", "mjcf", "sdf")
    CALLS: ClassVar[Mapping[str, str]] = CALLS
    STEP_DEFAULTS: ClassVar[Mapping[str, str]] = STEP_DEFAULTS
    refuses_without: ClassVar[tuple[str, ...]] = ("visual", "collision")
    searches_above: ClassVar[bool] = True

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        engine = bullet()
        self._form = checked_format(type(self), path)
        if self._form == "urdf":
            require_harmless(path, model)
        self._model = model
        fixed, flags = not model.floating, self._flags(calls)
        reading: dict[str, Any] = {
            "fixed": fixed,
            "flags": flags,
            "function": _FUNCTIONS[self._form],
            "parts": () if self._form == "urdf" else (model.root, *model.joint_names),
        }
        self._clients = [LoadedClient(engine, path, model.name, **reading)]
        try:
            self._prepare(calls)
            if self._client.refused and "pybullet.extrapolate_inertias" in calls:
                for times in (1, 2):
                    other = LoadedClient(engine, path, model.name, **reading)
                    self._clients.append(other)
                    self._set(other, calls)
                    other.apply(with_ballast(times))
                    other.make_tree()
        except BaseException:
            self.close()
            raise

    def _prepare(self, calls: Collection[str]) -> None:
        model, client = self._model, self._client
        root = client.call(client.engine.getBodyInfo, client.body)[0]
        children = {_text(info[12]): k for k, info in enumerate(client.joints)}
        is_world = self._form != "urdf" and not model.floating and model.root not in children
        self._links = {model.root if is_world else _text(root): ROOT, **children}
        if model.floating and not client.floating:
            raise UnusableEngineError(
                f"pybullet fixes {model.name} to the world: there its root {shown(model.root)} has no mass"
            )
        if self._form == "mjcf" and not model.floating and client.dynamics(ROOT)[0] != 0.0:
            raise UnusableEngineError(
                f"pybullet lets {model.name} float: its root {shown(model.root)} is fixed in the file alone"
            )
        self._order = self._find_joints()
        self._set(client, calls)
        # Last: inertias that are set after the first inverse dynamics would be ignored.
        client.make_tree()
        # The links of the model that Bullet has, their numbers there, and their poses in its frames.
        self._held = [k for k, link in enumerate(model.links) if link.name in self._links]
        self._numbers = [self._links[model.links[k].name] for k in self._held]
        frames = [inverse(client.com_frame(number)) for number in self._numbers]
        self._T_com_link = np.array(frames).reshape(-1, 4, 4)
        self._T_base_C = client.com_frame(ROOT)
        axes, center = self._T_base_C[:3, :3], self._T_base_C[:3, 3]
        self._X, self._X_inverse = base_conversion(axes, center), inverse_base_conversion(axes, center)

    def _set(self, client: LoadedClient, calls: Collection[str]) -> None:
        client.apply(disable_simulation_settings)
        if "pybullet.set_inertias" in calls:
            client.apply(set_inertias(self._model, self._links, restored=self._form == "urdf"))
        client.apply(set_joints({_text(client.joints[k][1]): k for k in client.moving}, calls))
        if "pybullet.no_contacts" in calls:
            client.apply(disable_contacts)

    @classmethod
    def _flags(cls, calls: Collection[str]) -> tuple[str, ...]:
        """Return the names of the flags with which the file is loaded."""
        return (USE_INERTIA,)

    @property
    def _client(self) -> LoadedClient:
        """The robot as it was loaded."""
        return self._clients[0]

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of the distribution, such as ``3.2.7``."""
        bullet()
        try:
            return version("pybullet")
        except PackageNotFoundError:
            return "unknown"

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        if form != "urdf":
            return f"robots = p.{_FUNCTIONS[form]}(path)"
        return f"robot = p.loadURDF(path, useFixedBase={not floating}, flags=p.URDF_USE_INERTIA_FROM_FILE)"

    def describe(self) -> LoadedModel:
        """Describe the model from `getDynamicsInfo` and `getJointInfo`."""
        base = self.link_poses(self._model.neutral())[0]
        if self._form != "urdf" and self._model.floating:
            base = np.eye(4)
        described = describe_model(self._client, self._model, self._links, base)
        if self._form == "sdf":
            # A joint of SDF has a frame of its own; its place shows in the poses of links.
            joints = {name: replace(joint, placement=None) for name, joint in described.joints.items()}
            described = replace(described, joints=joints)
        return replace(described, engine=self.name)

    def close(self) -> None:
        """Disconnect the client, or clients."""
        for client in self._clients:
            client.close()

    # -- quantities ------------------------------------------------------------------------------

    def link_poses(self, q: Floats) -> Floats:
        """Return the poses composed from those of the inertial frames."""
        client = self._client
        if self._model.floating:
            T_world_C = homogeneous(rotation_from_quat(q[3:7]), q[:3]) @ self._T_base_C
            quat = quat_from_rotation(T_world_C[:3, :3])
            client.place_base(T_world_C[:3, 3].tolist(), quat.tolist())
        positions, quats = client.com_poses(self._joints(q))
        position, quat = map(np.array, client.base_pose())
        # The root comes last, so that its number -1 finds it.
        T_world_com = homogeneous(
            rotation_from_quat(np.concatenate([quats, quat[None]])),
            np.concatenate([positions, position[None]]),
        )
        T = np.full((len(self._model.links), 4, 4), np.nan)
        T[self._held] = T_world_com[self._numbers] @ self._T_com_link
        return T

    @checks_types
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the result of `calculateJacobian` at the origin of the link frame.

        That call needs a moving joint; for the root, and for a robot without such a joint, the Jacobian is
        computed from the poses.
        """
        model = self._model
        base = 6 if model.floating else 0
        if link not in self._links:
            return np.full((6, model.nv), np.nan)
        if self._links[link] == ROOT or not self._client.moving:
            return self._base_jacobian(q, link)
        J_C = self._clients[-1].jacobian(self._joints(q), self._links[link], ORIGIN)
        J = np.zeros((6, model.nv))
        J[:, base:] = J_C[:, base:][:, self._order]
        if base:
            J[:, :6] = J_C[:, :6] @ self._X
            R_world_C = rotation_from_quat(q[3:7]) @ self._T_base_C[:3, :3]
            J = np.concatenate([R_world_C @ J[:3], R_world_C @ J[3:]])
        return J

    def _base_jacobian(self, q: Floats, link: str) -> Floats:
        """Return the Jacobian of a link that moves with the base only."""
        J = np.zeros((6, self._model.nv))
        if self._model.floating:
            R = rotation_from_quat(q[3:7])
            place = [each.name for each in self._model.links].index(link)
            arm = self.link_poses(q)[place, :3, 3] - q[:3]
            J[:3, :3] = J[3:, 3:6] = R
            J[:3, 3:6] = -skew(arm) @ R
        return J

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the result of `calculateMassMatrix`."""
        if not self._has_coordinates:
            return np.zeros((0, 0))
        M = self._extrapolate(lambda client: client.mass_matrix(self._joints(q)))
        base = 6 if self._model.floating else 0
        kept = [*range(base), *(base + k for k in self._order)]
        M = M[np.ix_(kept, kept)]
        if base:
            M[:6] = self._X.T @ M[:6]
            M[:, :6] = M[:, :6] @ self._X
        return M

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the result of `calculateInverseDynamics`."""
        if not self._has_coordinates:
            return np.zeros(0)
        if not self._model.floating:
            gravity = list(self._model.gravity)
            x = self._joints(q), self._in_bullet_order(v), self._in_bullet_order(a), gravity
            return self._extrapolate(lambda client: client.inverse_dynamics(*x))[self._order]
        v_C, a_C = self._X @ v[:6], self._X @ a[:6]
        # dv/dt in rotating axes to the classical acceleration of the centre of mass.
        a_C[3:] += cross(v_C[:3], v_C[3:])
        x = (
            self._joints(q),
            [*v_C.tolist(), *self._in_bullet_order(v[6:])],
            [*a_C.tolist(), *self._in_bullet_order(a[6:])],
            self._gravity_in_C(q),
        )
        tau = self._extrapolate(lambda client: client.inverse_dynamics(*x))
        # Bullet returns the force first.
        wrench = self._X.T @ np.concatenate([tau[3:6], tau[:3]])
        return np.concatenate([wrench, tau[6:][self._order]])

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the change of the velocity in one step of unit length.

        It is solved from mass matrix and inverse dynamics where a joint that the model lacks is held. On a
        floating base much lighter than what it carries Bullet's solution loses digits by rounding (four at a
        ratio of 3e-5), though it has the same robot as other engines. A step for the torque that is missed,
        where that is no more than rounding, restores them (iterative refinement).
        """
        if not self._has_coordinates:
            return np.zeros(0)
        if len(self._order) < len(self._client.moving):
            return self._solved_acceleration(q, v, tau)
        if not self._model.floating:
            gravity = list(self._model.gravity)
            step = self._client.velocity_step(
                self._joints(q), self._in_bullet_order(v), self._in_bullet_order(tau), gravity
            )
            return step[self._order]
        gravity = self._gravity_in_C(q)
        a = self._floating_acceleration(q, v, tau, gravity)
        if not np.isfinite(a).all():
            return a
        missed = tau - self.inverse_dynamics(q, v, a)
        largest = float(np.max(np.abs(self.mass_matrix(q)) @ np.abs(a)) + np.max(np.abs(tau)))
        if not 0.0 < np.max(np.abs(missed)) <= MAX_RESIDUAL * largest:
            return a
        # At rest and without gravity the rounding errors are relative to what is missed.
        return a + self._floating_acceleration(q, np.zeros_like(v), missed, [0.0, 0.0, 0.0])

    def contacts(self, q: Floats) -> Mapping[tuple[str, str], float]:
        """Pairs of `getContactPoints`, each shape by its link, or by the body that is not the robot.

        They act on forward dynamics alone. The base stands where it is for all quantities, at the origin.
        """
        client, engine = self._client, self._client.engine
        client.reset_joints(self._joints(q))
        client.call(engine.performCollisionDetection)
        links = {number: name for name, number in self._links.items()}

        def name(body: int, link: int) -> str:
            if body == client.body:
                return links.get(link, self._model.root)
            of_body = _text(client.call(engine.getBodyInfo, body)[0])
            return "the world" if of_body == _UNNAMED else of_body

        found: dict[tuple[str, str], float] = {}
        for point in client.call(engine.getContactPoints, client.body):
            if (depth := -float(point[8])) >= 0.0:
                one, other = sorted((name(point[1], point[3]), name(point[2], point[4])))
                found[one, other] = max(found.get((one, other), 0.0), depth)
        return found

    def _floating_acceleration(self, q: Floats, v: Floats, tau: Floats, gravity: list[float]) -> Floats:
        """Return the change of the velocity of a robot with a floating base in one step of unit length."""
        v_C, tau_C = self._X @ v[:6], self._X_inverse.T @ tau[:6]
        step = self._client.velocity_step(
            self._joints(q),
            [*v_C.tolist(), *self._in_bullet_order(v[6:])],
            [*tau_C.tolist(), *self._in_bullet_order(tau[6:])],
            gravity,
        )
        step[3:6] -= cross(v_C[:3], v_C[3:])
        return np.concatenate([self._X_inverse @ step[:6], step[6:][self._order]])

    # -- coordinates --------------------------------------------------------------------------

    def _find_joints(self) -> list[int]:
        """Return the index of each coordinate of dynx among those of Bullet."""
        engine, client = self._client.engine, self._client
        single = {engine.JOINT_REVOLUTE, engine.JOINT_PRISMATIC}
        kinds = {_text(info[1]): info[2] for info in client.joints}
        names = self._model.joint_names
        missing = [name for name in names if kinds.get(name) not in single]
        missing += [name for name, kind in kinds.items() if kind not in {*single, engine.JOINT_FIXED}]
        if missing:
            words = {engine.JOINT_SPHERICAL: "spherical", engine.JOINT_PLANAR: "planar"}
            words[engine.JOINT_FIXED] = "fixed"
            instead = {name: words.get(kinds.get(name), "not there") for name in missing}
            raise lacking_joints(self.name, self._model, instead)
        place = {_text(client.joints[k][1]): n for n, k in enumerate(client.moving)}
        return [place[name] for name in names]

    def coordinates(self) -> EngineCoordinates:
        """Return the numbers of the joints among those that are not fixed, after the inertial frame of a
        floating base."""
        in_q, in_v = (7, 6) if self._model.floating else (0, 0)
        n = len(self._client.moving)
        neutral, base = np.zeros(in_q + n), None
        if self._model.floating:
            neutral[6] = 1.0
            base = EngineBase(tuple(range(7)), tuple(range(6)), True, True, self._T_base_C)
        joints_q, joints_v = (tuple(first + k for k in self._order) for first in (in_q, in_v))
        return EngineCoordinates(neutral, in_v + n, joints_q, joints_v, (False,) * len(self._order), base)

    @property
    def _has_coordinates(self) -> bool:
        """True if there is any coordinate; Bullet returns None or an empty tuple where there is none."""
        return bool(self._client.moving) or self._model.floating

    def _extrapolate(self, quantity: Callable[[LoadedClient], Floats]) -> Floats:
        if len(self._clients) == 1:
            return quantity(self._client)
        return 2.0 * quantity(self._clients[1]) - quantity(self._clients[2])

    def _joints(self, q: Floats) -> list[float]:
        return self._in_bullet_order(q[7 if self._model.floating else 0 :])

    def _in_bullet_order(self, values: Floats) -> list[float]:
        """Return the last entries of `values`, one for each joint of dynx, in Bullet's order; zero for other
        joints."""
        n = len(self._order)
        x = [0.0] * len(self._client.moving)
        for place, value in zip(self._order, values[len(values) - n :].tolist(), strict=True):
            x[place] = value
        return x

    def _gravity_in_C(self, q: Floats) -> list[float]:
        R_world_C = rotation_from_quat(q[3:7]) @ self._T_base_C[:3, :3]
        gravity: list[float] = (R_world_C.T @ np.array(self._model.gravity)).tolist()
        return gravity


def _text(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape")


USE_FILE_INERTIA = "pybullet.use_file_inertia"
"""Id of the setting with which the plain call is that of `LoadedPyBullet`."""

KEEP_FIXED_LINKS = "pybullet.keep_fixed_links"
"""Id of the setting with which the call that merges links is that of `LoadedPyBullet`."""

_MERGE = "URDF_MERGE_FIXED_LINKS"


class PlainPyBullet(LoadedPyBullet):
    """A robot as PyBullet loads it without any flag; see the module docstring."""

    name: ClassVar[str] = "pybullet:plain"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf",)
    loads_meshes: ClassVar[bool] = True
    CALLS: ClassVar[Mapping[str, str]] = {
        **LoadedPyBullet.CALLS,
        USE_FILE_INERTIA: f"robot = p.loadURDF(path, ..., flags=p.{USE_INERTIA})",
    }

    @classmethod
    def _flags(cls, calls: Collection[str]) -> tuple[str, ...]:
        return (USE_INERTIA,) if USE_FILE_INERTIA in calls else ()

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return "robot = p.loadURDF(path)" if floating else "robot = p.loadURDF(path, useFixedBase=True)"


class MergingPyBullet(LoadedPyBullet):
    """A robot as PyBullet loads it with links on fixed joints merged into their parents."""

    name: ClassVar[str] = "pybullet:merge"
    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf",)
    CALLS: ClassVar[Mapping[str, str]] = {
        **LoadedPyBullet.CALLS,
        KEEP_FIXED_LINKS: f"robot = p.loadURDF(path, ..., flags=p.{USE_INERTIA})  # not p.{_MERGE}",
    }

    @classmethod
    def _flags(cls, calls: Collection[str]) -> tuple[str, ...]:
        return (USE_INERTIA,) if KEEP_FIXED_LINKS in calls else (USE_INERTIA, _MERGE)

    @classmethod
    @checks_types
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the call: one line, after ``import pybullet as p`` and ``p.connect(p.DIRECT)``."""
        return super().load_call(floating, root)[:-1] + f" | p.{_MERGE})"
