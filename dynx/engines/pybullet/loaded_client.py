"""A robot in Bullet, loaded from the user's file.

Settings that do not come from the file are set for rigid-body dynamics: no motors, no damping of the base, no
speed limit, steps of unit length. Joint damping and joint limits of the file stay as loaded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import Any

import numpy as np

from dynx.engines.pybullet.connection import ORIGIN, BulletConnection
from dynx.engines.silence import capture_output
from dynx.errors import EngineError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat

Setting = Callable[["LoadedClient"], None]


class LoadedClient(BulletConnection):
    """One robot as `loadURDF` loads it."""

    def __init__(
        self, engine: ModuleType, path: Path, robot: str, *, fixed: bool, flags: Iterable[str]
    ) -> None:
        """`flags` are names of constants of `engine` for ``loadURDF``."""
        super().__init__(engine, robot)
        self._fixed = fixed
        self._flags = sum(int(getattr(engine, flag)) for flag in flags)
        self._file = path.read_bytes()
        self._path = path
        self._settings: list[Setting] = []
        self._refusal: EngineError | None = None
        self._needs_tree = (
            engine.calculateInverseDynamics,
            engine.calculateMassMatrix,
            engine.calculateJacobian,
        )
        self.messages: list[str] = []
        """The lines that Bullet printed while it loaded."""
        self._connect()
        self.links = list(range(int(self.call(engine.getNumJoints, self.body))))
        self.joints = [self.call(engine.getJointInfo, self.body, k) for k in self.links]
        """`getJointInfo` of every joint, as loaded."""
        self.moving = [k for k, info in enumerate(self.joints) if info[2] != engine.JOINT_FIXED]
        self.floating = not fixed and self.dynamics(ROOT)[0] != 0.0
        """True if the base moves: Bullet holds a root without mass still."""

    def apply(self, setting: Setting) -> None:
        """Change a setting now, and again whenever the client is reopened."""
        self._settings.append(setting)
        setting(self)

    def call(self, function: Callable[..., Any], *args: Any, **options: Any) -> Any:
        """Call the engine and return the result. Raises EngineError also if the call needs a tree that
        Bullet refused to make."""
        if self._refusal is not None and function in self._needs_tree:
            # A second call would fail again and print messages.
            raise EngineError(str(self._refusal)) from self._refusal
        return super().call(function, *args, **options)

    def dynamics(self, link: int) -> Any:
        """Call `getDynamicsInfo` for a link."""
        return self.call(self.engine.getDynamicsInfo, self.body, link)

    def com_frame(self, link: int) -> Floats:
        """Return T_link_com (4, 4), the inertial frame of a link as Bullet holds it."""
        info = self.dynamics(link)
        return homogeneous(rotation_from_quat(np.array(info[4])), np.array(info[3]))

    def make_tree(self) -> None:
        """Make the tree of Bullet's inverse dynamics. If Bullet refuses, calls that need it raise errors."""
        rest = [0.0] * (len(self.moving) + (6 if self.floating else 0))
        if not rest:
            return
        self._refusal = None
        try:
            with capture_output(self.messages):
                self.inverse_dynamics([0.0] * len(self.moving), rest, rest, ORIGIN)
        except EngineError as error:
            self._refusal = error

    @property
    def refused(self) -> bool:
        """True if Bullet refused to make that tree."""
        return self._refusal is not None

    def _reopen(self) -> None:
        super()._reopen()
        for setting in self._settings:
            setting(self)
        self.make_tree()

    def _load(self) -> None:
        if self._path.is_file() and self._path.read_bytes() == self._file:
            self._load_from(self._path)
            return
        # The file is gone or another when a robot is loaded again.
        with TemporaryDirectory(prefix="dynx-", ignore_cleanup_errors=True) as folder:
            path = Path(folder) / "robot.urdf"
            path.write_bytes(self._file)
            self._load_from(path)

    def _load_from(self, path: Path) -> None:
        options = {"useFixedBase": self._fixed, "flags": self._flags}
        self.messages.clear()
        with capture_output(self.messages):
            body = self.call(self.engine.loadURDF, str(path), **options)
        self.body = int(body)
