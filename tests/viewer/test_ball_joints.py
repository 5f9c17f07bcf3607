"""Robots with ball joints in the viewer: sliders, arrows of torques, motions, worlds."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dynx
from dynx.model import Limits
from dynx.spatial.so3 import quat_log
from dynx.world import Scene, SceneRobot, World
from tests.sim.test_ball_joints import arm

EPS = np.finfo(np.float64).eps


def test_sliders_turn_a_ball_joint() -> None:
    model = arm("floating", limits=Limits(upper=1.0))
    first = model.position_index("shoulder")
    with model.view() as viewer:
        sliders = viewer.view._sliders
        q = model.random(0)
        viewer.update(q)
        vector = np.degrees(quat_log(q[first : first + 4]))
        shown = [handle.value for handle in sliders._handles[6:9]]
        np.testing.assert_allclose(shown, vector, atol=0.1)
        assert sliders._handles[6].max == pytest.approx(np.degrees(1.0), abs=0.1)
        for k, degrees in enumerate((30.0, -20.0, 10.0)):
            sliders._handles[6 + k].value = degrees
            sliders._moved(6 + k, SimpleNamespace(client=0))
        turned = quat_log(viewer.view.q[first : first + 4])
        np.testing.assert_allclose(np.degrees(turned), [30.0, -20.0, 10.0], atol=0.1)
        # Beyond the largest angle it is turned back.
        for k in range(3):
            sliders._handles[6 + k].value = 57.0
            sliders._moved(6 + k, SimpleNamespace(client=0))
        assert np.linalg.norm(quat_log(viewer.view.q[first : first + 4])) <= 1.0 + 8 * EPS
        elbow = 9
        sliders._handles[elbow].value = 45.0
        sliders._moved(elbow, SimpleNamespace(client=0))
        assert viewer.view.q[model.position_index("elbow")] == pytest.approx(np.pi / 4, abs=1e-3)


def test_torques_of_a_ball_joint_are_about_the_axes_of_its_child() -> None:
    model = arm()
    with model.view() as viewer:
        view = viewer.view
        view._torques.shown = True
        q = model.random(1)
        viewer.update(q)
        drawn = {name: ends for name, _, ends in view._torques._arrows_at(q)}
        with dynx.backend("reference", model) as engine:
            tau = engine.gravity_torque(q)
            R = engine.forward_kinematics(q, "upper")[:3, :3]
        for k, name in enumerate(model.coordinate_names[:3]):
            start, end = drawn[name]
            along = (end - start) / np.linalg.norm(end - start)
            np.testing.assert_allclose(along, np.sign(tau[k]) * R[:, k], atol=1e-6)


def test_motions_and_worlds_are_shown() -> None:
    model = arm()
    run = dynx.simulate(model, duration=0.05, dt=1e-3, plant="reference", q0=model.random(0))
    with run.view() as viewer:
        assert viewer.view.motion.at(-1)
    scene = Scene("arm", robots=(SceneRobot("arm", model, q=model.random(0)),))
    with World(scene, "dynx") as world, world.view():
        world.step(5)
