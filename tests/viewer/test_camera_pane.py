"""Panes show what a camera sees: colours, depth, and parts that are told apart."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Pose
from dynx.viewer.camera_pane import depth_shades, part_colour, part_colours
from dynx.world import Camera, Scene, World, box, ground
from tests.viewer.conftest import OpenPage, connected, until

CUBE = box("cube", (0.4, 0.4, 0.4), mass=1.0, pose=Pose((0.0, 0.0, 1.0)))
SCENE = Scene("yard", bodies=(ground(), CUBE))
CAMERA = Camera.look_at((2.0, -2.0, 1.5), (0.0, 0.0, 0.5), size=(48, 36))


def test_a_pane_shows_the_picture_of_the_world_as_it_moves() -> None:
    with World(SCENE) as world, world.view(steps=False) as viewer:
        pane = viewer.camera_pane(CAMERA, "wrist", "parts")
        first = world.camera(CAMERA)
        assert np.array_equal(pane.picture.segmentation, first.segmentation)
        assert np.array_equal(pane.image, part_colours(first))
        cube = pane.image[first.mask("cube")]
        assert (cube == part_colour(first.names.index("cube"))).all()
        assert not (pane.image[~first.mask("cube")] == cube[0]).all(axis=-1).any()
        world.step(100)
        viewer.update()
        wanted = world.camera(CAMERA)
        assert not np.array_equal(wanted.segmentation, first.segmentation)
        until(lambda: np.array_equal(pane.picture.segmentation, wanted.segmentation), "the picture")
        pane.shows = "colours"
        assert np.array_equal(pane.image, wanted.rgb)
        pane.shows = "depth"
        assert np.array_equal(pane.image, depth_shades(wanted.depth))
        viewer.remove_all()
        with pytest.raises(ArgumentError, match="shows is 'dept'; did you mean 'depth'"):
            viewer.camera_pane(CAMERA, shows="dept")
        with pytest.raises(UnknownNameError):
            viewer.camera_pane(Camera(part="cub"))


def test_panes_of_a_robot_and_of_a_motion_show_it() -> None:
    arm = dynx.load(
        "<robot name='r'>"
        "<link name='a'><visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual></link>"
        "<link name='b'><inertial><mass value='1'/><inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
        "</inertial><visual><geometry><box size='0.2 0.2 0.2'/></geometry></visual></link>"
        "<joint name='j' type='prismatic'><parent link='a'/><child link='b'/><axis xyz='1 0 0'/>"
        "<limit lower='-2' upper='2' effort='10' velocity='10'/></joint></robot>"
    )
    with arm.view(q=[0.5]) as viewer:
        pane = viewer.camera_pane(CAMERA, shows="parts")
        before = pane.picture.mask("r/b")
        assert before.any()
        viewer.update([-0.5])
        until(lambda: not np.array_equal(pane.picture.mask("r/b"), before), "the picture")
    rollout = dynx.simulate(arm, duration=0.3, v0=[1.0])
    with rollout.view() as viewer:
        pane = viewer.camera_pane(Camera.look_at((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), size=(48, 36)))
        before = pane.picture.mask("r/b")
        viewer.view.go_to(0.3)
        until(lambda: not np.array_equal(pane.picture.mask("r/b"), before), "the picture")


def test_near_is_lighter_than_far_and_nothing_is_black() -> None:
    grey = depth_shades(np.array([[1.0, 2.0, 50.0, np.inf]]))
    assert grey[0, :, 0].tolist() == [255, 128, 5, 0]
    assert not depth_shades(np.full((2, 2), np.inf)).any()


def test_parts_with_numbers_beside_each_other_differ_clearly() -> None:
    colours = [np.array(part_colour(k), dtype=float) for k in range(60)]
    for k in range(50):
        for one, other in itertools.combinations(colours[k : k + 5], 2):
            assert np.abs(one - other).max() > 40.0


def test_the_page_shows_a_pane_and_its_kinds(open_page: OpenPage) -> None:
    with World(SCENE) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        pane = viewer.camera_pane(CAMERA, "wrist")
        page.page.get_by_text("48 x 36 pixels").wait_for()
        page.page.get_by_label("shows").last.click()
        page.page.get_by_role("option", name="parts").click()
        until(lambda: pane.shows == "parts", "the choice")
        page.page.get_by_text("■ cube").last.wait_for()
        size = "[...document.images].map(each => [each.naturalWidth, each.naturalHeight].join())"
        until(lambda: "48,36" in page.page.evaluate(size), "the picture")
        pane.remove()
        until(lambda: "48,36" not in page.page.evaluate(size), "the picture to go")
        assert not page.errors
