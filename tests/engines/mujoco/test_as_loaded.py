"""MuJoCo as it loads a file, in the coordinates of dynx."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.errors import EngineError
from dynx.loaded import load_as
from dynx.loaded.difference import model_difference
from dynx.model import Inertial, JointDynamics, Link, Mimic, Model
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies.geometry import Strategy
from tests.backends.robots import chain, motion
from tests.loaded import fork
from tests.loaded.files import TILTED, clean_robots, error, loaded
from tests.loaded.fork import BASES, BODY, LOSSES, NO_LOSSES

pytest.importorskip("mujoco")
import mujoco

from dynx.engines.mujoco.as_loaded import CALLS, LoadedMujoco
from dynx.engines.mujoco.library import MAX_DEPTH

KEPT = '<mujoco><compiler fusestatic="false"/></mujoco>'
BALL = '<collision><geometry><sphere radius="0.3"/></geometry></collision>'


def robots() -> Strategy[Model]:
    """Robots with a joint or more, but for what MuJoCo takes for the world to float in."""
    return clean_robots().filter(
        lambda model: model.nv > 0 and not (model.floating and model.root == "world")
    )


def solid(model: Model) -> Model:
    """Return the robot with a body on each link that moves and weighs too little for MuJoCo."""
    moved = {joint.child for joint in model.joints if joint.moves} | ({model.root} & _floating(model))
    return replace(model, links=tuple(_solid(link) if link.name in moved else link for link in model.links))


def _floating(model: Model) -> set[str]:
    return {model.root} if model.floating else set()


def _solid(link: Link) -> Link:
    inertial = link.inertial or Inertial()
    light = inertial.mass < 1e-9 or np.linalg.eigvalsh(inertial.tensor)[0] < 1e-9
    return replace(link, inertial=BODY) if light else link


def with_tags(model: Model, tags: str) -> str:
    return model.to_urdf().replace("</robot>", f"{tags}</robot>")


def errors(robot: LoadedMujoco, model: Model, seed: int = 0) -> dict[str, float]:
    """Relative errors as the doctor measures them; of poses and Jacobians, over the links that are left."""
    reference = ReferenceBackend(model)
    q, v, a = motion(model, seed)
    poses, wanted = robot.link_poses(q), reference.forward_kinematics(q)
    kept = ~np.isnan(poses[:, 0, 0])
    found = {"poses": error(poses[kept], wanted[kept]) if kept.any() else 0.0}
    for link in (link.name for link, here in zip(model.links, kept, strict=True) if here):
        J = reference.jacobian(q, link)
        if J.any():
            found["jacobian"] = max(found.get("jacobian", 0.0), error(robot.jacobian(q, link), J))
    tau = reference.inverse_dynamics(q, v, a)
    found["mass matrix"] = error(robot.mass_matrix(q), reference.mass_matrix(q))
    found["inverse dynamics"] = error(robot.inverse_dynamics(q, v, a), tau)
    again = reference.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau))
    found["forward dynamics"] = error(again, tau)
    return found


def worst(
    model: Model, text: str | None = None, calls: Collection[str] = (), truth: Model | None = None
) -> float:
    with loaded(LoadedMujoco, model, text, calls) as robot:
        assert isinstance(robot, LoadedMujoco)
        return max(errors(robot, truth or model).values())


def forked(base: Base = "fixed", dynamics: JointDynamics = NO_LOSSES) -> Model:
    """Return the fork with limits that MuJoCo, which turns them into forces, never meets."""
    return fork.forked(base, dynamics, wide=True)


# -- quantities -----------------------------------------------------------------------------------


@given(st.data())
def test_clean_robots_are_loaded_as_dynx_reads_them(data: st.DataObject) -> None:
    model = solid(data.draw(robots()))
    text = with_tags(model, KEPT) if data.draw(st.booleans()) else None
    calls = ["mujoco.no_limits"]
    with loaded(LoadedMujoco, model, text, calls) as robot:
        assert isinstance(robot, LoadedMujoco)
        assert max(errors(robot, model, data.draw(st.integers(0, 99))).values()) <= BAR


@given(robots())
def test_what_it_holds_is_what_the_file_says(model: Model) -> None:
    joints = tuple(replace(joint, dynamics=replace(joint.dynamics, armature=0.0)) for joint in model.joints)
    model = solid(replace(model, joints=joints))
    # A range without width is no limit to MuJoCo, with a warning.
    pinned = {j.name for j in joints if j.type != "continuous" and j.limits.lower == j.limits.upper}
    with loaded(LoadedMujoco, model) as robot:
        different = {(d.name, d.property) for d in model_difference(model, [robot.describe()])}
    assert different == {(name, end) for name in pinned for end in ("lower", "upper")}


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", ["ur5", "panda", "solo12", "kinova"])
def test_real_robots(name: str, base: Base) -> None:
    model = load(name, base=base, gravity=TILTED)
    model = replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))
    if base == "floating" and model.root == "world":
        with pytest.raises(EngineError, match="MuJoCo mistakes a root named 'world' for the world"):
            worst(model)
        return
    assert worst(model, calls=CALLS) <= BAR


@pytest.mark.parametrize("base", BASES)
def test_links_that_are_fused_have_no_frame(base: Base) -> None:
    model = forked(base)
    with loaded(LoadedMujoco, model) as robot:
        held = robot.describe()
        gone = {"tool"} if base == "floating" else {"trunk", "tool"}
        assert set(held.missing_links) == gone
        assert held.links["z"].merged == ("tool",)
        poses = robot.link_poses(model.neutral())
        for link, T in zip(model.links, poses, strict=True):
            assert np.isnan(T).all() == (link.name in gone)
            assert np.isnan(robot.jacobian(model.neutral(), link.name)).all() == (link.name in gone)
    with loaded(LoadedMujoco, model, with_tags(model, KEPT)) as robot:
        assert robot.describe().missing_links == ()
        assert np.isfinite(robot.link_poses(model.neutral())).all()


@pytest.mark.parametrize("base", BASES)
def test_links_fused_or_not_the_answers_are_those_of_the_file(base: Base) -> None:
    model = forked(base)
    for text in (None, with_tags(model, KEPT)):
        assert worst(model, text) <= BAR


def test_a_fixed_root_named_world_is_the_world() -> None:
    model = forked()
    text = model.to_urdf().replace('"trunk"', '"world"')
    with loaded(LoadedMujoco, load(text), text) as robot:
        np.testing.assert_array_equal(robot.link_poses(model.neutral())[0], np.eye(4))


@pytest.mark.parametrize("base", BASES)
def test_no_order_of_calls_changes_a_result(base: Base) -> None:
    model = forked(base, LOSSES)
    q, v, a = motion(model)
    others = motion(model, 1)
    with loaded(LoadedMujoco, model) as robot:
        calls: tuple[Callable[[], Floats], ...] = (
            lambda: robot.link_poses(q),
            lambda: robot.jacobian(q, "z"),
            lambda: robot.mass_matrix(q),
            lambda: robot.inverse_dynamics(q, v, a),
            lambda: robot.forward_dynamics(q, v, a),
        )
        alone = [call() for call in calls]
        rng = np.random.default_rng(0)
        for _ in range(60):
            robot.forward_dynamics(*others)
            calls[rng.integers(len(calls))]()
            index = int(rng.integers(len(calls)))
            np.testing.assert_array_equal(calls[index](), alone[index])


# -- forces that MuJoCo adds, and the calls that remove them ----------------------------------------


def test_damping_and_friction_are_in_the_torque() -> None:
    model = forked(dynamics=LOSSES)
    q, v, a = motion(model)
    tau = ReferenceBackend(model).inverse_dynamics(q, v, a)
    extra = {(): 0.5 * v[0] + 0.25 * np.sign(v[0]), ("mujoco.no_damping",): 0.25 * np.sign(v[0])}
    extra[("mujoco.no_friction",)] = 0.5 * v[0]
    extra[("mujoco.no_damping", "mujoco.no_friction")] = 0.0
    for calls, wanted in extra.items():
        with loaded(LoadedMujoco, model, None, calls) as robot:
            assert error(robot.inverse_dynamics(q, v, a), tau + np.array([wanted, 0.0])) <= BAR, calls


def test_a_limit_that_is_violated_pushes_back() -> None:
    model = forked()
    tight = model.to_urdf().replace('lower="-9.0" upper="9.0"', 'lower="-0.001" upper="0.001"')
    assert worst(model, tight) > 1e-3
    assert worst(model, tight, ["mujoco.no_limits"]) <= BAR


def test_mimic_is_an_equality_constraint() -> None:
    free = forked()
    following = replace(
        free.joints[1 + [j.name for j in free.joints].index("weld")], mimic=Mimic("z_joint", 2.0)
    )
    text = replace(
        free, joints=tuple(following if j.name == following.name else j for j in free.joints)
    ).to_urdf()
    assert "<mimic" in text
    with loaded(LoadedMujoco, free, text) as robot:
        assert any("mimic" in remark for remark in robot.describe().remarks)
    assert worst(free, text) > 1e-3
    assert worst(free, text, ["mujoco.no_mimic"]) <= BAR


def test_shapes_that_touch_push_each_other() -> None:
    model = forked()
    touching = model.to_urdf().replace("</inertial>", f"</inertial>{BALL}")
    with loaded(LoadedMujoco, model, touching) as robot:
        assert any("touch" in remark for remark in robot.describe().remarks)
    assert worst(model, touching) > 1e-3
    assert worst(model, touching, ["mujoco.no_contacts"]) <= BAR


def test_the_inertia_of_a_massless_welded_link_is_lost_by_fusing() -> None:
    model = forked()
    spun = replace(BODY, mass=0.0)
    model = replace(
        model, links=tuple(replace(x, inertial=spun) if x.name == "tool" else x for x in model.links)
    )
    assert worst(model) > 1e-3
    assert worst(model, with_tags(model, KEPT)) <= BAR
    with loaded(LoadedMujoco, model) as robot:
        assert [(d.name, d.property) for d in model_difference(model, [robot.describe()])] == [
            ("z", "inertia")
        ]


def test_a_link_without_inertial_weighs_what_its_shape_does() -> None:
    """As if it were of water."""
    model = forked()
    bare = replace(model, links=tuple(replace(x, inertial=None) if x.name == "a" else x for x in model.links))
    text = bare.to_urdf().replace('<link name="a"/>', f'<link name="a">{BALL}</link>')
    with loaded(LoadedMujoco, bare, text) as robot:
        mass = robot.describe().links["a"].mass
    assert abs(mass / (1000.0 * 4.0 / 3.0 * np.pi * 0.3**3) - 1.0) <= BAR


# -- refusals --------------------------------------------------------------------------------------

REFUSED = {
    "no inertial": (None, "mass and inertia of moving bodies must be larger than mjMINVAL; .*'a'"),
    "no mass": (replace(BODY, mass=0.0), "mjMINVAL"),
    "negative mass": (replace(BODY, mass=-1.0), "mjMINVAL"),
    "triangle": (Inertial(1.0, ixx=0.5, iyy=0.1, izz=0.1), "A \\+ B >= C; .*'a'"),
    "rounding": (Inertial(1.0, ixx=0.25, iyy=0.5, izz=0.7500000000000001), "A \\+ B >= C"),
    "negative": (Inertial(1.0, ixx=-0.1, iyy=0.1, izz=0.1), "positive eigenvalues"),
    "rod": (Inertial(1.0, ixx=0.0, iyy=0.1, izz=0.1), "positive eigenvalues"),
    "below 1e-14": (Inertial(1.0, ixx=9e-15, iyy=9e-15, izz=9e-15), "positive eigenvalues"),
}


@pytest.mark.parametrize("kind", REFUSED)
def test_inertias_that_it_refuses(kind: str) -> None:
    inertial, words = REFUSED[kind]
    model = forked()
    model = replace(
        model, links=tuple(replace(x, inertial=inertial) if x.name == "a" else x for x in model.links)
    )
    with pytest.raises(EngineError, match=f"mujoco refuses robot.urdf: .*{words}"):
        worst(model)


@pytest.mark.parametrize(
    "tip",
    [
        Inertial(2e-15, ixx=1.1e-14, iyy=1.1e-14, izz=1.1e-14),
        Inertial(1.0, ixx=0.25, iyy=0.5, izz=0.75),
    ],
)
def test_inertias_that_it_just_takes(tip: Inertial) -> None:
    """The least that a moving link may weigh (1e-15) and resist (1e-14); a plate."""
    model = forked()
    model = replace(model, links=tuple(replace(x, inertial=tip) if x.name == "a" else x for x in model.links))
    with loaded(LoadedMujoco, model) as robot:
        assert error(robot.mass_matrix(np.zeros(2)), ReferenceBackend(model).mass_matrix(np.zeros(2))) <= BAR


def test_what_is_no_file(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "absent.urdf"):
        with pytest.raises(EngineError, match="no regular file"):
            LoadedMujoco(path, forked())


def test_chains_that_crash_mujoco_are_refused() -> None:
    with pytest.raises(EngineError, match=f"links in a row.*{MAX_DEPTH}"):
        worst(chain(MAX_DEPTH, "fixed"))


def test_a_joint_that_it_lacks() -> None:
    model = forked()
    with pytest.raises(EngineError, match=r"mujoco lacks joints .*: 'a_joint' \(not there\)"):
        worst(model, model.to_urdf().replace('name="a_joint"', 'name="other"'))


def test_a_file_that_it_cannot_read_is_refused_in_its_words() -> None:
    model = forked()
    with pytest.raises(EngineError, match="bad format in attribute"):
        worst(model, model.to_urdf().replace('rpy="0.1 0.2 0.3"', 'rpy="x y z"'))


# -- manners -----------------------------------------------------------------------------------------


def test_it_prints_nothing_and_writes_no_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    # A mass matrix that is singular but for 1e-15, and limits that are equal: both are warned about.
    crumb = Inertial(1.1e-15, ixx=1.1e-14, iyy=1.1e-14, izz=1.1e-14)
    model = forked()
    model = replace(
        model, links=tuple(replace(x, inertial=crumb) if x.name == "a" else x for x in model.links)
    )
    text = model.to_urdf().replace('lower="-9.0" upper="9.0"', 'lower="0.5" upper="0.5"')
    q, v, a = motion(model)
    with loaded(LoadedMujoco, model, text) as robot:
        for _ in range(2):
            robot.forward_dynamics(q, v, a)
            robot.inverse_dynamics(q, v, a)
    assert capfd.readouterr() == ("", "")
    assert os.listdir(tmp_path) == []


def test_the_call_that_is_shown_is_a_call_that_loads(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(forked().to_urdf())
    for floating, nv in ((False, 2), (True, 8)):
        names = {"mujoco": mujoco, "path": str(path)}
        exec(LoadedMujoco.load_call(floating), names)
        for code in LoadedMujoco.CALLS.values():
            exec(code, names)
        assert names["model"].nv == nv


def test_it_is_found_by_name_and_closes(tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    model = forked()
    path.write_text(model.to_urdf())
    robot = load_as("mujoco", path, model, ["pybullet.something"])
    assert robot.engine_version() == mujoco.__version__
    robot.close()
    robot.close()
    with pytest.raises(AttributeError):
        robot.mass_matrix(model.neutral())
