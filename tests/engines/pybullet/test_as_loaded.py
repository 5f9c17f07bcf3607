"""PyBullet as it loads a file: robots that it loads as dynx reads them, and the run around it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.agreement.tolerances import BAR
from dynx.engines.pybullet.as_loaded import LoadedPyBullet
from dynx.errors import EngineError
from dynx.loaded.difference import model_difference
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import chain, motion
from tests.loaded import fork
from tests.loaded.files import TILTED, assert_alike, clean, clean_robots, error, loaded
from tests.loaded.fork import BASES, BODY

bullet = pytest.importorskip("pybullet")

UNHINDERED = ("pybullet.no_limits", "pybullet.no_damping")


def forked(base: Base) -> Model:
    """Return the fork with principal inertias, which PyBullet reads as they stand."""
    return clean(fork.forked(base))


@given(st.data())
def test_clean_robots_are_loaded_as_dynx_reads_them(data: st.DataObject) -> None:
    model = data.draw(clean_robots())
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
        assert_alike(robot, model, data.draw(st.integers(0, 99)))
        assert [row.part for row in model_difference(model, [robot.describe()])] == ["gravity"]


@pytest.mark.parametrize("base", BASES)
def test_a_robot_is_asked_in_the_coordinates_of_dynx(base: Base) -> None:
    model = forked(base)
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
        for seed in range(3):
            assert_alike(robot, model, seed)


@pytest.mark.parametrize("name", ["ur5", "solo12", "so100"])
def test_real_robots_that_are_clean_are_loaded_as_dynx_reads_them(name: str) -> None:
    model = dynx.load(name, gravity=TILTED)
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
        assert_alike(robot, model)


@pytest.mark.parametrize("base", BASES)
def test_what_it_holds_comes_in_the_frames_of_the_file(base: Base) -> None:
    model = forked(base)
    with loaded(LoadedPyBullet, model) as robot:
        held = robot.describe()
    assert [row.part for row in model_difference(model, [held])] == ["gravity"]
    assert held.links["tool"].mass == BODY.mass
    assert held.links["tool"].merged == ()
    assert (held.joints["a_joint"].type, held.joints["z_joint"].type) == ("prismatic", "continuous")
    assert held.joints["a_joint"].limits == (-0.3, 0.7)
    assert (held.joints["a_joint"].velocity, held.joints["a_joint"].effort) == (2.0, 9.0)
    assert held.gravity.tolist() == [0.0, 0.0, 0.0]
    assert held.missing_links == ()


@pytest.mark.parametrize("base", BASES)
def test_a_robot_without_joints_has_answers(base: Base) -> None:
    links = [Link("body", BODY), Link("tip", BODY)]
    weld = Joint("weld", "fixed", "body", "tip", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    model = clean(Model.build("rock", links, [weld], base=base, gravity=TILTED))
    with loaded(LoadedPyBullet, model) as robot:
        if model.floating:
            assert_alike(robot, model)
        else:
            none = np.zeros(0)
            assert robot.mass_matrix(none).shape == (0, 0)
            assert robot.inverse_dynamics(none, none, none).shape == (0,)
            assert robot.forward_dynamics(none, none, none).shape == (0,)
            assert robot.jacobian(none, "tip").shape == (6, 0)


@pytest.mark.parametrize("base", BASES)
def test_no_order_of_calls_changes_a_result(base: Base) -> None:
    model = forked(base)
    q, v, x = motion(model)
    other, w, y = motion(model, 1)
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
        first = [robot.link_poses(q), robot.inverse_dynamics(q, v, x), robot.forward_dynamics(q, v, x)]
        robot.forward_dynamics(other, w, y)
        robot.link_poses(other)
        again = [robot.link_poses(q), robot.inverse_dynamics(q, v, x), robot.forward_dynamics(q, v, x)]
    for one, two in zip(first, again, strict=True):
        np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("base", BASES)
def test_a_joint_that_the_model_lacks_is_held_at_zero(base: Base) -> None:
    model = forked(base)
    locked = dynx.load(model, lock={"a_joint": 0.0})
    with loaded(LoadedPyBullet, locked, model.to_urdf()) as robot:
        assert_alike(robot, locked)


def test_robots_of_equal_size_in_one_process_keep_apart() -> None:
    robots = [replace(chain(3), links=tuple(_heavier(chain(3), k))) for k in (1.0, 2.0, 5.0)]
    for model in robots * 2:
        with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
            assert_alike(robot, model)


def _heavier(model: Model, by: float) -> list[Link]:
    body = Inertial(by, Pose((0.1, 0.0, 0.0)), ixx=0.3 * by, iyy=0.4 * by, izz=0.5 * by)
    return [replace(link, inertial=body) for link in model.links]


@pytest.mark.parametrize("mass", [1e-5, 1e-6])
def test_rounding_on_a_light_floating_base_is_no_difference(mass: float) -> None:
    light = Inertial(mass, ixx=mass, iyy=mass, izz=mass)
    heavy = Inertial(1.5, ixx=1.0, iyy=1.0, izz=1.0)
    links = (Link("base", light), Link("upper", replace(heavy, mass=0.05)), Link("lower", heavy))
    axes = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    places = (Pose((-0.1, 1.0, 0.7)), Pose((0.0, -0.5, 0.0)))
    joints = tuple(
        Joint(f"joint{k}", "revolute", links[k].name, links[k + 1].name, origin=places[k], axis=axes[k])
        for k in range(2)
    )
    model = Model("light", links, joints, base="floating")
    reference = ReferenceBackend(model)
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot, dynx.backend("pybullet", model) as engine:
        for seed in range(5):
            q, v, a = motion(model, seed)
            tau = reference.inverse_dynamics(q, v, a)
            for found in (robot.forward_dynamics(q, v, tau), engine.forward_dynamics(q, v, tau)):
                assert error(reference.inverse_dynamics(q, v, found), tau) < BAR
            assert error(robot.mass_matrix(q), reference.mass_matrix(q)) < BAR


def test_a_state_that_overflows_is_left_behind() -> None:
    model = forked("fixed")
    q, v, tau = motion(model)
    with loaded(LoadedPyBullet, model, calls=UNHINDERED) as robot:
        wanted = robot.forward_dynamics(q, v, tau)
        with np.errstate(over="ignore", invalid="ignore"):
            spoiled = robot.forward_dynamics(q, np.full(model.nv, 1e200), tau)
        assert not np.isfinite(spoiled).all()
        np.testing.assert_array_equal(robot.forward_dynamics(q, v, tau), wanted)
        assert_alike(robot, model)


def test_numbers_that_are_not_finite_raise() -> None:
    model = forked("fixed")
    bad = np.array([np.nan, 0.0])
    fine = np.zeros(2)
    with loaded(LoadedPyBullet, model) as robot:
        calls: tuple[Callable[[], object], ...] = (
            lambda: robot.link_poses(bad),
            lambda: robot.mass_matrix(bad),
            lambda: robot.inverse_dynamics(fine, bad, fine),
            lambda: robot.forward_dynamics(fine, fine, bad),
        )
        for call in calls:
            with pytest.raises(EngineError, match="NaN or infinity"):
                call()


def test_clients_are_disconnected() -> None:
    model = forked("floating")
    with loaded(LoadedPyBullet, model) as robot:
        assert isinstance(robot, LoadedPyBullet)
        clients = [each.number for each in robot._clients]
        assert all(bullet.isConnected(client) for client in clients)
    assert not any(bullet.isConnected(client) for client in clients)
    with pytest.raises(EngineError, match="failed in"):
        robot.mass_matrix(model.neutral())


def test_a_load_that_fails_gives_its_client_back(monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[int] = []
    connect = bullet.connect

    def counting(*args: Any) -> int:
        made.append(connect(*args))
        return made[-1]

    monkeypatch.setattr(bullet, "connect", counting)
    model = forked("fixed")
    text = model.to_urdf().replace("prismatic", "Prismatic")
    with (
        pytest.raises(EngineError, match="failed in loadURDF for forked: Cannot load URDF"),
        loaded(LoadedPyBullet, model, text),
    ):
        pass
    assert made
    assert not any(bullet.isConnected(client) for client in made)


def test_engine_output_is_captured_and_not_printed(capfd: pytest.CaptureFixture[str]) -> None:
    model = forked("fixed")
    bare = replace(model, links=tuple(replace(link, inertial=None) for link in model.links))
    with loaded(LoadedPyBullet, bare) as robot:
        held = robot.describe()
    assert any("No inertial data for link" in line for line in held.remarks)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("base", BASES)
def test_the_calls_that_are_shown_can_be_made(base: Base, tmp_path: Path) -> None:
    model = forked(base)
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    client = bullet.connect(bullet.DIRECT)
    try:
        # The lines name no client: a user has one.
        names: dict[str, Any] = {"p": _Client(client), "path": str(path), "link": 0}
        names |= {"ixx": 0.1, "iyy": 0.2, "izz": 0.25, "k": 1, "s": 0.5}
        names |= {"tau_of_the_first": 3.0, "tau_of_the_second": 1.0}
        exec(LoadedPyBullet.load_call(model.floating), names)
        for code in LoadedPyBullet.CALLS.values():
            exec(code, names)
        assert names["tau"] == 5.0
        assert bullet.getBodyInfo(names["robot"], physicsClientId=client)[1] == b"forked"
    finally:
        bullet.disconnect(client)
    assert LoadedPyBullet.engine_version().startswith("3.")


@pytest.mark.parametrize("base", BASES)
def test_what_a_step_does_by_itself_is_shown_with_the_call_that_switches_it_off(
    base: Base, tmp_path: Path
) -> None:
    model = forked(base)
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    rng = np.random.default_rng(0)
    speeds = rng.uniform(1.0, 3.0, len(model.joint_names))
    (switched_off,) = LoadedPyBullet.STEP_DEFAULTS.values()

    def accelerations(*calls: str) -> Floats:
        """Return those of joints in a step from these speeds, without motors and joint damping."""
        client = bullet.connect(bullet.DIRECT)
        try:
            names: dict[str, Any] = {"p": _Client(client), "path": str(path)}
            exec(LoadedPyBullet.load_call(model.floating), names)
            p, robot = names["p"], names["robot"]
            p.setTimeStep(1e-4)
            for code in (LoadedPyBullet.CALLS["pybullet.no_damping"], *calls):
                exec(code, names)
            moving = [
                j for j in range(p.getNumJoints(robot)) if p.getJointInfo(robot, j)[2] != bullet.JOINT_FIXED
            ]
            for joint, speed in zip(moving, speeds, strict=True):
                p.setJointMotorControl2(robot, joint, bullet.VELOCITY_CONTROL, force=0)
                p.resetJointState(robot, joint, 0.1, speed)
            p.stepSimulation()
            return np.array([p.getJointState(robot, j)[1] for j in moving]) - speeds
        finally:
            bullet.disconnect(client)

    # The call for the root acts on all links, as the calls on every one of them do.
    each = f"for k in range(-1, p.getNumJoints(robot)): {switched_off.replace('-1', 'k')}"
    as_loaded, free, free_each = accelerations(), accelerations(switched_off), accelerations(each)
    assert np.array_equal(free, free_each)
    assert np.abs(as_loaded - free).max() > 1e-3 * np.abs(free).max()


class _Client:
    """The module `pybullet` with one client."""

    def __init__(self, client: int) -> None:
        self._client = client

    def __getattr__(self, name: str) -> Any:
        found = getattr(bullet, name)
        if not callable(found):
            return found
        return lambda *args, **options: found(*args, **options, physicsClientId=self._client)
