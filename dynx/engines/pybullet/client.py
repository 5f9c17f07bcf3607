"""A robot in Bullet for the backend: loaded from a canonical URDF, and verified against what was written."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from dynx.engines.pybullet.canonical_urdf import BulletTree, write_bullet_urdf
from dynx.engines.pybullet.connection import ORIGIN, BulletConnection, Reals
from dynx.errors import DynxError, EngineError, EngineLimitError, NotFiniteError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat

MAX_JOINTS = 121
"""Largest number of moving joints. Bullet's state has room for 128 numbers, 7 of them for the base even if
it is fixed: joints from the 122nd on are read as 0, and above 128 inverse dynamics is silently wrong
(pybullet 3.2.7)."""


class BulletClient(BulletConnection):
    """A Bullet world with one robot, without motors, joint limits, damping or a speed limit."""

    not_finite_error: ClassVar[type[DynxError]] = NotFiniteError

    def __init__(self, engine: ModuleType, tree: BulletTree, robot: str) -> None:
        """Raises EngineLimitError for a robot that Bullet cannot represent, EngineError if Bullet fails."""
        if len(tree.links) > MAX_JOINTS:
            raise EngineLimitError(
                f"{robot} has {len(tree.links)} moving joints; Bullet supports at most {MAX_JOINTS}"
            )
        super().__init__(engine, robot)
        self._tree = tree
        self.floating = tree.floating
        self.links = self.moving = list(range(len(tree.links)))
        self._connect()

    def com_pose(self, joints: Reals, link: int) -> tuple[Reals, Reals]:
        """Return the position (3,) and attitude, quat_xyzw (4,), of the inertial frame of one link."""
        self.reset_joints(joints)
        state = self.call(self.engine.getLinkState, self.body, link, 0, 1)
        return state[0], state[1]

    def inverse_kinematics(
        self,
        joints: Reals,
        link: int,
        position: Reals,
        quat_xyzw: Reals,
        limits: tuple[Reals, Reals] | None,
        iterations: int,
        residual: float,
    ) -> Floats:
        """Return the joints (n,) at which Bullet's damped least squares stopped, starting from `joints`.

        Position and attitude are those of the link's origin and principal axes. Selectively damped
        least squares is not offered: with an attitude it can end the process.
        """
        self.check(joints, position, quat_xyzw)
        options: dict[str, Any] = {}
        if limits is not None:
            lower, upper = limits
            options = {
                "lowerLimits": lower,
                "upperLimits": upper,
                "jointRanges": [high - low for low, high in zip(lower, upper, strict=True)],
                "restPoses": joints,
            }
        found = self.call(
            self.engine.calculateInverseKinematics,
            self.body,
            link,
            position,
            quat_xyzw,
            currentPositions=joints,
            maxNumIterations=iterations,
            residualThreshold=residual,
            solver=self.engine.IK_DLS,
            **options,
        )
        return np.array(found)

    # -- loading ------------------------------------------------------------------------------

    def _load(self) -> None:
        flags = self.engine.URDF_USE_INERTIA_FROM_FILE
        try:
            with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
                path = Path(folder) / "robot.urdf"
                path.write_text(write_bullet_urdf(self._tree), encoding="ascii")
                fixed = not self.floating
                self.body = int(self.call(self.engine.loadURDF, str(path), useFixedBase=fixed, flags=flags))
        except OSError as error:
            raise EngineError(f"the file through which Bullet loads {self._robot}: {error}") from error
        self.disable_damping()
        if self.floating:
            self._set_inertia(ROOT, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            self._set_inertia(k, link.inertia.moments)
        self.release_motors()
        self._verify()

    def _set_inertia(self, link: int, moments: Floats) -> None:
        # This must precede the first inverse dynamics, whose tree ignores later changes.
        self.call(self.engine.changeDynamics, self.body, link, localInertiaDiagonal=moments.tolist())

    def _verify(self) -> None:
        """Raise EngineError unless Bullet has the values that were written, because it can misread numbers
        and drop inertias."""
        if self.call(self.engine.getNumJoints, self.body) != len(self.links):
            self._misread("the number of joints")
        if self.floating:
            self._verify_inertia(ROOT, self._tree.root.mass, self._tree.root.moments)
        for k, link in enumerate(self._tree.links):
            info = self.call(self.engine.getJointInfo, self.body, k)
            kind = self.engine.JOINT_REVOLUTE if link.revolute else self.engine.JOINT_PRISMATIC
            if (info[1], info[2], info[16]) != (f"j{k}".encode(), kind, link.parent):
                self._misread(f"joint {k}")
            self._expect("the axis", k, info[13], link.inertia.axes.T @ link.axis)
            self._verify_inertia(k, link.inertia.mass, link.inertia.moments)
        self._verify_placements()
        if self.links or self.floating:
            rest = [0.0] * (len(self.links) + (6 if self.floating else 0))
            # This makes the tree of the inverse dynamics, or fails if Bullet refuses an inertia.
            self.inverse_dynamics([0.0] * len(self.links), rest, rest, ORIGIN)

    def _verify_inertia(self, link: int, mass: float, moments: Floats) -> None:
        info = self.call(self.engine.getDynamicsInfo, self.body, link)
        if info[0] != mass or list(info[2]) != moments.tolist():
            self._misread(f"the inertia of link {link}")

    def _verify_placements(self) -> None:
        """Compare the inertial frames at zero with the joint frames that were written."""
        at: dict[int, tuple[Any, Any]] = {ROOT: (np.eye(3), np.zeros(3))}
        positions, quats = self.com_poses([0.0] * len(self.links))
        rotations = rotation_from_quat(quats)
        for k, link in enumerate(self._tree.links):
            R_parent, p_parent = at[link.parent]
            R, p = R_parent @ link.R, p_parent + R_parent @ link.p
            at[k] = R, p
            self._expect("the centre of mass", k, positions[k], p + R @ link.inertia.center)
            self._expect("the principal axes", k, rotations[k], R @ link.inertia.axes)

    def _expect(self, property: str, link: int, found: Any, written: Any) -> None:
        written = np.asarray(written, dtype=np.float64)
        # A misread number differs in its leading digits, so a coarse comparison is enough.
        tolerance = 1e-6 * max(1.0, float(np.max(np.abs(written))))
        if not np.allclose(found, written, rtol=1e-6, atol=tolerance):
            self._misread(f"{property} of link {link}")

    def _misread(self, subject: str) -> None:
        raise EngineError(f"Bullet has not read {subject} of {self._robot} as it was written")
