"""Motions that the page plays, and how far two of them are apart."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.sim import ScenePlant
from dynx.spatial.scalar import Floats
from dynx.viewer import export
from dynx.viewer.export import film_length, picture_of, stage_for
from dynx.viewer.motion import (
    MAX_FRAMES,
    MotionFrames,
    motion_of_reference,
    motion_of_rollout,
    motion_of_run,
    motion_separation,
)
from dynx.viewer.motion_view import Curves, MotionView, _power
from dynx.viewer.page import Page
from dynx.world import Scene, SceneRobot, box, ground, read_scene
from dynx.world.comparison import compare_engines

GOAL = [0.5, -0.4, 0.3, 0.2, -0.3, 0.4]


@pytest.fixture(scope="module")
def rollout() -> dynx.Rollout:
    """An arm on its way to a goal, from a start beside the reference."""
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(6), GOAL, duration=0.5)
    controller = dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0)
    return dynx.simulate(arm, controller, motion, q0=np.full(6, 0.05), dt=1e-3)


def test_frames_begin_with_the_first_state_and_end_with_the_last(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert motion.t[0] == rollout.t[0]
    assert motion.t[-1] == rollout.t[-1]
    assert len(motion.t) <= MAX_FRAMES
    with dynx.backend("reference", rollout.model) as engine:
        for k, state in ((0, 0), (-1, -1)):
            for link in rollout.model.links:
                expected = engine.forward_kinematics(rollout.q[state], link.name)
                found = motion.poses[f"{rollout.model.name}/{link.name}"][k]
                assert np.abs(found - expected).max() < 1e-12, link.name


def test_frames_are_found_by_time(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert motion.frame_at(-1.0) == 0
    assert motion.frame_at(float(motion.t[3])) == 3
    assert motion.frame_at(0.5 * float(motion.t[3] + motion.t[4])) == 3
    assert motion.frame_at(1e9) == len(motion.t) - 1


def test_the_reference_is_another_motion_of_the_same_parts(rollout: dynx.Rollout) -> None:
    motion, reference = motion_of_rollout(rollout), motion_of_reference(rollout)
    assert reference is not None
    assert set(reference.poses) == set(motion.poses)
    apart = motion_separation(motion, reference)
    assert apart.distance[0] > 1e-3
    assert apart.distance[-1] < apart.distance[0]
    assert set(apart.parts) <= set(motion.poses)
    assert motion_of_reference(replace(rollout, reference=None)) is None


def test_a_motion_is_not_apart_from_itself(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert not motion_separation(motion, motion).distances.any()


def accelerated(name: str, t: Floats) -> MotionFrames:
    """Return the motion of a body along x = t^2 [m]."""
    T = np.tile(np.eye(4), (len(t), 1, 1))
    T[:, 0, 3] = t**2
    return MotionFrames(name, t, {"body": T}, {})


def test_frames_at_other_times_and_a_shorter_motion_do_not_part() -> None:
    a, b = accelerated("a", np.linspace(0.0, 2.0, 121)), accelerated("b", np.linspace(0.0, 1.0, 37))
    for first, second in ((a, b), (b, a)):
        apart = motion_separation(first, second)
        # Between frames h apart a line is at most h^2 / 8 of the acceleration from the motion.
        step = float(np.diff(second.t).max())
        assert apart.largest <= 2.0 * step**2 / 8.0 + 1e-12
        assert np.array_equal(apart.times, first.t[first.t <= 1.0 + 1e-9])
    with pytest.raises(
        ArgumentError,
        match=r"no common time .*: one is from 0 to 1 s, the other from 5 to 6 s",
    ):
        motion_separation(b, accelerated("later", np.linspace(5.0, 6.0, 10)))


def test_the_longer_of_two_motions_is_shown_to_its_end(rollout: dynx.Rollout) -> None:
    long = motion_of_rollout(rollout, "long")
    short = replace(long, name="short", t=long.t[:10], poses={n: T[:10] for n, T in long.poses.items()})
    with Page(port=0) as page:
        view = MotionView(page, short, long, compare=True)
        assert view.duration == pytest.approx(long.t[-1] - long.t[0])
        view.go_to(view.duration)
        for shown, motion in ((view.drawn, short), (view._ghost_drawn, long)):
            assert shown is not None
            for name, T in motion.at(-1).items():
                assert np.allclose(shown.pose(name), T)
    assert film_length((short, long)) == film_length((long,)) > film_length((short,))


@pytest.mark.parametrize("duration", [0.0, 1e-4, 0.06, 0.2, 1.0, 2.0, 7.77, 60.0])
def test_a_film_lasts_as_long_as_its_motion_and_shows_each_time_at_that_time(
    duration: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    films, times = [], []

    def written(path: object, pictures: Iterable[object], period: float) -> None:
        films.append((len(list(pictures)), period))

    def drawn(motions: object, time: float, *_: object) -> None:
        times.append(time)

    monkeypatch.setattr(export, "write_pictures", written)
    monkeypatch.setattr(export, "picture_of", drawn)
    motion = accelerated("a", 3.0 + np.linspace(0.0, duration, 200))
    export.write_film("a.gif", (motion,))
    ((count, period),) = films
    assert count == film_length((motion,))
    assert np.allclose(times, 3.0 + period * np.arange(count))
    shortest = 0.5 / export.PICTURES_PER_SECOND
    assert count * period == pytest.approx(max(duration, shortest), rel=1e-12)
    assert period >= shortest


@pytest.mark.parametrize(
    ("largest", "power"), [(2.0, 0), (0.05, 0), (0.02, 3), (1e-3, 3), (4e-5, 6), (3e-14, 0)]
)
def test_small_values_of_a_plot_have_a_power_of_ten(largest: float, power: int) -> None:
    assert _power(np.array([0.0, -largest, np.nan])) == power


def test_what_is_not_finite_is_refused(rollout: dynx.Rollout) -> None:
    q = rollout.q.copy()
    q[50, 2] = np.nan
    with pytest.raises(ArgumentError, match=r"entry 2 of q is nan at 0\.05 s \(state 50 of 501\)"):
        motion_of_rollout(replace(rollout, q=q))
    assert rollout.reference is not None
    reference = rollout.reference._replace(q=q)
    with pytest.raises(ArgumentError, match="entry 2 of q of the reference is nan"):
        motion_of_reference(replace(rollout, reference=reference))


def test_times_that_do_not_ascend_are_refused(rollout: dynx.Rollout) -> None:
    t = rollout.t.copy()
    t[7] = np.nan
    with pytest.raises(ArgumentError, match="the time of state 7 is nan"):
        motion_of_rollout(replace(rollout, t=t))
    with pytest.raises(ArgumentError, match=r"times must ascend; after 0\.5 s comes 0\.499 s"):
        motion_of_rollout(replace(rollout, t=rollout.t[::-1]))


def test_motions_without_a_common_part_are_refused(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    renamed = replace(motion, poses={f"other/{name}": T for name, T in motion.poses.items()})
    with pytest.raises(ArgumentError, match="no part in common"):
        motion_separation(motion, renamed)
    still = replace(motion, poses={})
    with pytest.raises(ArgumentError, match="nothing moves in them"):
        motion_separation(still, still)


def test_a_picture_of_two_motions_that_coincide_shows_the_solid_one() -> None:
    cube = box("cube", (0.2, 0.2, 0.2), mass=1.0)
    poses = np.broadcast_to(np.eye(4), (2, 4, 4)).copy()
    poses[1, :3, 3] = [0.3, -0.3, 0.3]
    motion = MotionFrames("m", np.array([0.0, 1.0]), {"cube": poses}, {}, (cube,))
    later = replace(motion, poses={"cube": poses[::-1]})
    stage = stage_for(motion, (160, 120))
    alone = picture_of((motion,), 0.0, stage)
    assert len(np.unique(alone.reshape(-1, 3), axis=0)) > 2
    # A motion by rounding is none.
    close = replace(motion, poses={"cube": poses + 1e-9})
    assert np.array_equal(picture_of((motion, close), 0.0, stage), alone)
    both = picture_of((motion, later), 0.0, stage)
    changed = (both != alone).any(axis=2)
    assert changed.sum() > 100
    # Sky blue, in any light.
    assert (both[changed][:, 2] > both[changed][:, 0]).all()


def test_a_picture_of_a_robot_without_shapes_shows_its_links(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    (model,) = motion.robots.values()
    assert not any(model.geometry.visuals(link.name) for link in model.links)
    stage = stage_for(motion, (160, 120))
    camera = stage.camera
    picture = picture_of((motion,), 0.5, stage)
    without = picture_of((replace(motion, robots={}),), 0.5, stage)
    poses, T_camera_world = motion.at(-1), np.linalg.inv(camera.pose.matrix)
    focal = 0.5 * 120 / np.tan(0.5 * camera.field_of_view)
    for joint in model.joints:
        ends = [poses[f"{model.name}/{name}"][:3, 3] for name in (joint.parent, joint.child)]
        x, y, z = (T_camera_world @ [*(0.5 * (ends[0] + ends[1])), 1.0])[:3]
        column, row = round(80 + focal * x / z - 0.5), round(60 + focal * y / z - 0.5)
        if np.linalg.norm(ends[1] - ends[0]) > 0.0:
            assert np.abs(picture[row, column].astype(int) - without[row, column]).max() > 20, joint.name


def test_contact_forces_of_a_rollout_are_those_on_what_can_move() -> None:
    arm = dynx.load("six_axis_arm")
    cube = box("cube", (0.1, 0.1, 0.1), mass=0.5, pose=dynx.Pose((3.0, 0.0, 0.05)))
    scene = Scene("rest", robots=(SceneRobot("arm", arm),), bodies=(ground(), cube))
    controller = dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0)
    rollout = dynx.simulate(arm, controller, np.zeros(6), plant=ScenePlant(scene, "arm"), duration=0.3)
    assert rollout.surroundings is not None
    assert rollout.surroundings.contacts.force_on("ground")[-1, 2] < 0.0
    forces = motion_of_rollout(rollout).contacts[-1].forces
    assert forces.sum(axis=0) == pytest.approx([0.0, 0.0, 0.5 * 9.81], abs=0.05)


def test_runs_of_a_scene_are_as_far_apart_as_their_comparison_says() -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pybullet")
    scene = read_scene("slope")
    compared = compare_engines(scene, ["pybullet", "mujoco"], 0.2, samples=10)
    a, b = (motion_of_run(scene, run) for run in compared.runs)
    assert np.allclose(motion_separation(a, b).distance, compared.separations[0].distance, atol=1e-12)


def test_one_of_many_curves_is_chosen_and_keeps_its_colour_while_the_time_moves() -> None:
    names = [f"joint{k}" for k in range(9)]
    t = np.linspace(0.0, 1.0, 11)
    values = np.outer(t, np.arange(9.0))
    with Page(port=0) as page:
        curves = Curves(page, "torque", t, values, names)
        plot = curves._plot
        colours = [each["stroke"] for each in plot.series[1:]]
        assert not plot.legend["show"]
        curves._pick("joint3")
        curves.put(0.5, at_once=True)
        time, row = plot.data
        assert np.array_equal(time, t)
        assert np.array_equal(row[:6], values[:6, 3])
        assert np.isnan(row[6:]).all()
        assert plot.legend["show"]
        assert plot.series[1]["stroke"] == colours[3]
        assert plot.series[1]["label"].startswith("joint3")
        low, high = plot.scales["y"]["range"]
        assert low < 0.0 < 3.0 < high < 3.5
        curves._pick("(all)")
        assert len(plot.data) == 10
        curves.put(1.0, at_once=True)
        assert np.array_equal(np.stack(plot.data[1:], axis=1), values)
