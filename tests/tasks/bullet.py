"""PyBullet as its users call it, for the checks."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
from pybullet_utils.bullet_client import BulletClient  # type: ignore[import-untyped]

from tests.tasks.task import Array, Wrong


@contextmanager
def loaded(text: str) -> Iterator[tuple[Any, int]]:
    """Yield a PyBullet client that has loaded a URDF text with a fixed base, and the number of the body."""
    client = BulletClient(connection_mode=pybullet.DIRECT)
    try:
        client.setPhysicsEngineParameter(enableFileCaching=0)
        client.setGravity(0, 0, -9.81)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "robot.urdf")
            path.write_text(text)
            try:
                body = client.loadURDF(
                    str(path), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE
                )
            except pybullet.error as error:
                raise Wrong(f"PyBullet does not load the file: {error}") from None
        yield client, body
    finally:
        client.disconnect()


def inverse_dynamics(text: str, q: Array, v: Array, a: Array) -> Array:
    """Return the joint torques that PyBullet computes for a URDF text."""
    with loaded(text) as (client, body):
        return np.array(client.calculateInverseDynamics(body, list(q), list(v), list(a)))
