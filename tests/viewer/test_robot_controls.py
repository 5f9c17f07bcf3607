"""Sliders and the handle of a robot, and the plots of its rollout."""

from __future__ import annotations

import numpy as np

import dynx
from dynx.viewer import view


def test_a_joint_with_equal_limits_has_a_slider_of_few_digits() -> None:
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>'
        '<child link="b"/><axis xyz="0 0 1"/><limit lower="0.3" upper="0.3" effort="1" velocity="1"/></joint>'
        "</robot>"
    )
    with view(dynx.load(text)) as viewer:
        (slider,) = viewer.view._sliders._handles
        assert slider.disabled
        assert (slider.min, slider.value, slider.max) == (17.19, 17.19, 17.19)
        assert viewer.view.q == [0.3]
        viewer.view.put([0.5])
        assert (slider.min, slider.value, slider.max) == (17.19, 28.65, 28.65)


def test_the_handle_has_what_its_target_moves() -> None:
    with view(dynx.load("six_axis_arm")) as viewer:
        handle = viewer.view._handle
        node = handle._node
        expected = {None: (False, False), "rotation": (False, True), "position": (True, False)}
        for free, (no_arrows, no_rings) in expected.items():
            handle.free = free
            assert node.disable_axes == node.disable_sliders == no_arrows
            assert node.disable_rotations == no_rings


def test_all_curves_of_a_rollout_have_the_axis_of_the_whole_motion() -> None:
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(arm.nq), np.full(arm.nq, 1e-3), duration=0.001)
    rollout = dynx.simulate(arm, dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0), motion)
    assert len(rollout.t) == 2  # There is one torque.
    with rollout.view() as viewer:
        ranges = [curves._plot.scales["x"]["range"] for curves in viewer.view._curves]
        assert ranges == [(0.0, 0.001)] * 3
