"""The replay of PyBullet's loader and of its checks, against PyBullet."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from dynx.engines.pybullet.file_checks import bullet_reading, diagonalisation_error, tree_may_reject
from dynx.engines.pybullet.library import bullet
from dynx.engines.silence import silence
from dynx.model.elements import Inertial, Pose
from dynx.rules.case import Case
from dynx.rules.inertia import with_inertials
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies import inertials
from tests.rules.documents import case_of, joint, link

bodies = inertials("any").map(lambda inertial: inertial or Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0))
coordinates = st.floats(-1.0, 1.0)


def arm(inertial: Inertial) -> Case:
    case = case_of(link("base"), link("arm"), joint("shoulder", "base", "arm"))
    return with_inertials(case, {"arm": inertial})


class Bullet:
    """A client in which one robot after the other is loaded from one file."""

    def __init__(self, folder: Path) -> None:
        self.engine = bullet()
        self.client = self.engine.connect(self.engine.DIRECT)
        self.path = folder / "robot.urdf"
        self.engine.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=self.client)

    def load(self, case: Case) -> int:
        self.path.write_text(case.source.text, encoding="utf-8")
        with silence():
            self.engine.resetSimulation(physicsClientId=self.client)
            flags = self.engine.URDF_USE_INERTIA_FROM_FILE
            body = self.engine.loadURDF(
                str(self.path), useFixedBase=True, flags=flags, physicsClientId=self.client
            )
        return int(body)

    def moments(self, case: Case) -> Any:
        return self.engine.getDynamicsInfo(self.load(case), 0, physicsClientId=self.client)[2]

    def refuses(self, case: Case) -> bool:
        body = self.load(case)
        try:
            with silence():
                self.engine.calculateMassMatrix(body, [0.0], physicsClientId=self.client)
        except (SystemError, self.engine.error):
            return True
        return False


@pytest.fixture(scope="module")
def engine(tmp_path_factory: pytest.TempPathFactory) -> Any:
    client = Bullet(tmp_path_factory.mktemp("bullet"))
    yield client
    client.engine.disconnect(client.client)


@given(inertial=bodies)
def test_the_loader_is_replayed_to_the_last_bit(engine: Bullet, inertial: Inertial) -> None:
    expected = bullet_reading(inertial)
    held = engine.moments(arm(inertial))
    assert list(held) == ([0.0] * 3 if expected.zeroed else expected.moments.tolist())


@given(st.tuples(coordinates, coordinates, coordinates), st.floats(0.1, 3.0), st.sampled_from((0.0, 0.1)))
def test_what_the_tree_refuses_was_foreseen(
    engine: Bullet, center: tuple[float, float, float], mass: float, moment: float
) -> None:
    # A point or a rod: the inertia about the origin has a moment of zero, or a sum of equal sides.
    inertial = Inertial(mass, Pose(center), ixx=moment, iyy=moment)
    if engine.refuses(arm(inertial)):
        assert tree_may_reject(inertial, on_fixed_joint=False)


@settings(suppress_health_check=[HealthCheck.filter_too_much])
@given(inertials("solid").map(lambda inertial: inertial or Inertial()))
def test_a_solid_body_gives_no_cause(inertial: Inertial) -> None:
    assert not bullet_reading(inertial).zeroed
    assert not tree_may_reject(inertial, on_fixed_joint=False)


points = st.tuples(coordinates, coordinates, coordinates)


@given(points, points, st.tuples(*[st.floats(0.01, 0.02)] * 3), st.floats(-4.0, 0.0))
def test_on_a_fixed_joint_a_heavy_point_is_refused_and_a_solid_body_of_any_size_is_not(
    center: tuple[float, float, float],
    rpy: tuple[float, float, float],
    moments: tuple[float, float, float],
    power: float,
) -> None:
    size = 10.0**power
    pose = Pose(tuple((size * np.array(center)).tolist()), rpy)
    ixx, iyy, izz = (size * size * np.array(moments)).tolist()
    assert not tree_may_reject(Inertial(1.0, pose, ixx=ixx, iyy=iyy, izz=izz), on_fixed_joint=True)
    # A point has no moment about the line through the origin: its tensor there is singular. Bullet tolerates
    # the rounding of a light one.
    if np.linalg.norm(center) > 0.3:
        assert tree_may_reject(Inertial(100.0, Pose(center, rpy)), on_fixed_joint=True)


def test_the_diagonalisation_is_roughest_where_moments_are_nearly_equal() -> None:
    rough = Inertial(1.0, ixx=0.025, iyy=0.022, izz=0.025, ixy=-3e-5, ixz=-1e-5)
    assert 1e-6 < diagonalisation_error(rough) < 3e-6
    assert diagonalisation_error(Inertial(1.0, ixx=0.025, iyy=0.022, izz=0.025)) == 0.0
    R = rotation_from_rpy(np.array([0.1, 0.2, 0.3]))
    tensor = R @ np.diag([0.01, 0.02, 0.025]) @ R.T
    turned = Inertial(
        1.0,
        ixx=float(tensor[0, 0]),
        iyy=float(tensor[1, 1]),
        izz=float(tensor[2, 2]),
        ixy=float(tensor[0, 1]),
        ixz=float(tensor[0, 2]),
        iyz=float(tensor[1, 2]),
    )
    assert diagonalisation_error(turned) < 1e-9
