"""One page: inline in a notebook, and showing one thing after another."""

from __future__ import annotations

import re
import urllib.request
from html import escape
from xml.sax.saxutils import quoteattr

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.world import World
from dynx.world.scene import read_scene
from tests.viewer.conftest import poses_of_nodes


def test_a_notebook_shows_the_page_inline() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    code = "import dynx; dynx.load('six_axis_arm').view()"
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(code)])
    client = nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3")
    with client.setup_kernel():
        client.execute_cell(notebook.cells[0], 0)
        # viser displays its addresses in a notebook unless it is silenced.
        (output,) = notebook.cells[0].outputs
        source = re.search(r'<iframe src="(http://127\.0\.0\.1:\d+/[\w-]+/)"', output.data["text/html"])
        assert source is not None
        with urllib.request.urlopen(source[1], timeout=30.0) as page:
            assert b"<title>dynx: six_axis_arm</title>" in page.read()


def test_one_page_shows_one_thing_after_another() -> None:
    arm = dynx.load("six_axis_arm")
    rollout = dynx.simulate(arm, duration=0.2)
    with World(read_scene("stack")) as world, rollout.view(play=True) as viewer:
        viewer.slider("gain", 0.0, 1.0)
        url, timeline = viewer.url, viewer.view.timeline
        viewer.show(world, steps=False)
        timeline._thread.join(10.0)
        assert not timeline._thread.is_alive()
        world.step(10)
        viewer.update()
        shown, expected = poses_of_nodes(viewer.view.drawn), world.state.bodies
        for name, body in expected.items():
            assert np.allclose(shown[name][:3, 3], body.position, atol=1e-5)
        viewer.show(arm, q=arm.random(0))
        with urllib.request.urlopen(url, timeout=30.0) as page:
            assert b"<title>dynx: six_axis_arm</title>" in page.read()
        assert np.array_equal(viewer.view.q, arm.random(0))
        assert viewer.url == url
        with pytest.raises(ArgumentError, match="no option 'play'"):
            viewer.show(arm, play=True)
        assert not viewer.page.closed
    with pytest.raises(ArgumentError, match="is closed"):
        viewer.show(arm)


def test_a_title_is_no_html() -> None:
    name = "a</title><script>alert(1)</script>"
    robot = dynx.load(f"<robot name={quoteattr(name)}><link name='base'/></robot>")
    with robot.view() as viewer, urllib.request.urlopen(viewer.url, timeout=30.0) as page:
        assert f"<title>dynx: {escape(name)}</title>".encode() in page.read()


def test_a_closed_viewer_shows_no_page_in_a_notebook() -> None:
    with dynx.load("six_axis_arm").view() as viewer:
        assert "<iframe" in viewer._repr_html_()
    assert "<iframe" not in viewer._repr_html_()
    assert "closed" in viewer._repr_html_()


def test_a_world_with_the_same_parts_replaces_another_below_the_same_controls() -> None:
    scene = read_scene("stack")
    with (
        World(scene) as first,
        World(scene) as second,
        World(read_scene("slope")) as other,
        first.view(steps=False) as viewer,
    ):
        button = viewer.view._button
        second.step(10)
        assert viewer.view.replace(second)
        viewer.follow(next(iter(second.state.bodies)))
        for name, body in second.state.bodies.items():
            assert np.allclose(viewer.view.drawn.pose(name)[:3, 3], body.position)
            assert np.allclose(poses_of_nodes(viewer.view.drawn)[name][:3, 3], body.position, atol=1e-5)
        assert viewer.view._button is button
        assert not viewer.view.replace(other)
        assert viewer.view.world is second
