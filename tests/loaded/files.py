"""Robots written to a file and loaded by an engine, compared with the reference."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from dynx.loaded import LoadedRobot
from dynx.model import Inertial, Model
from dynx.model.elements import JointDynamics
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from dynx.testing.strategies.geometry import Strategy
from dynx.testing.strategies.models import BaseChoice
from tests.backends.robots import assert_close, motion
from tests.error_bounds import ErrorBounds, samples_at

TILTED = (0.3, -0.7, -9.81)
"""Gravity [m/s^2] along no axis, which shows values in a wrong frame."""


@contextmanager
def loaded(
    kind: type[LoadedRobot], model: Model, text: str | None = None, calls: Collection[str] = ()
) -> Iterator[LoadedRobot]:
    """`model`, or another text, written to a temporary file and loaded by an engine."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.urdf"
        path.write_text(model.to_urdf() if text is None else text, encoding="utf-8")
        robot = kind(path, model, calls)
    with robot:
        yield robot


def file_robots(base: BaseChoice = "either", *, solvable: bool = False) -> Strategy[Model]:
    """Robots that URDF can express, without mimic joints, in tilted gravity."""
    drawn = models(base=base, mimics=False, locks=False, from_urdf=True, solvable=solvable)
    return drawn.map(lambda model: model.with_gravity(TILTED))


def clean_robots(base: BaseChoice = "either") -> Strategy[Model]:
    """Robots that all engines load alike: see `clean`."""
    return file_robots(base, solvable=True).map(clean)


def clean(model: Model) -> Model:
    """The robot with principal inertias far from any bound, no damping, and no mass on a fixed base."""
    links = []
    for link in model.links:
        inertial = link.inertial or Inertial()
        moments = np.linalg.eigvalsh(inertial.tensor)
        # With the largest added to each, no two of them come near the third.
        ixx, iyy, izz = (moments + moments[2]).tolist()
        body = Inertial(inertial.mass, inertial.origin, ixx=ixx, iyy=iyy, izz=izz)
        still = not model.floating and link.name == model.root
        links.append(replace(link, inertial=Inertial() if still else body))
    joints = tuple(replace(joint, dynamics=JointDynamics()) for joint in model.joints)
    return replace(model, links=tuple(links), joints=joints)


def assert_alike(robot: LoadedRobot, model: Model, seed: int = 0, *, solve: bool = True) -> None:
    """Assert that every result of the engine is that of the reference at a random state."""
    reference = ReferenceBackend(model)
    q, v, a = motion(model, seed)
    near = ErrorBounds(samples_at(model, q, v, a))
    n = len(model.links)
    assert_close(robot.link_poses(q), reference.forward_kinematics(q)[:n], what="poses")
    for link in model.links:
        assert_close(robot.jacobian(q, link.name), reference.jacobian(q, link.name), what=link.name)
    near.check("mass_matrix", robot.mass_matrix(q), reference.mass_matrix(q))
    near.check("inverse_dynamics", robot.inverse_dynamics(q, v, a), reference.inverse_dynamics(q, v, a))
    if solve:
        tau = reference.inverse_dynamics(q, v, a)
        found = robot.forward_dynamics(q, v, tau)
        ErrorBounds(samples_at(model, q, v, a, tau)).check_solves(
            found, reference.inverse_dynamics(q, v, found), tau
        )


def error(got: Floats, wanted: Floats) -> float:
    """Relative error in the max norm, as the doctor measures it."""
    return float(np.max(np.abs(got - wanted)) / np.max(np.abs(wanted)))
