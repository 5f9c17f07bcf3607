"""The first picture of a page comes without what it does not need."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import dynx
from dynx.viewer import Viewer
from dynx.viewer.moving_picture import MOVING
from tests.viewer.conftest import OpenPage, connected, until

LOG = """
  window.firsts = [];
  const told = (what) => { if (!window.firsts.includes(what)) window.firsts.push(what); };
  const draw = WebGL2RenderingContext.prototype.drawElements;
  WebGL2RenderingContext.prototype.drawElements = function (...given) {
    told("shapes");
    return draw.apply(this, given);
  };
  const source = WebGL2RenderingContext.prototype.shaderSource;
  WebGL2RenderingContext.prototype.shaderSource = function (shader, text) {
    if (/gainMap/.test(text)) told("surroundings");
    return source.call(this, shader, text);
  };
  new MutationObserver(() => {
    if (document.querySelector(".mantine-Slider-root")) told("controls");
  }).observe(document, {childList: true, subtree: true});
"""
"""Script that notes in which order shapes are drawn, controls are added and surroundings are decoded."""


def test_shapes_are_drawn_before_controls_and_without_surroundings(open_page: OpenPage) -> None:
    with dynx.load("ur5").view(whole_meshes=False) as viewer:
        page = open_page()
        page.page.add_init_script(LOG)
        page.go_to(viewer.url)
        until(lambda: len(page.page.evaluate("firsts")) >= 2, "shapes and controls")
        page.page.wait_for_timeout(1000.0)
        assert page.page.evaluate("firsts") == ["shapes", "controls"]
        assert page.page.evaluate("window.__viserMutable.scene.environment") is None
        assert not page.errors


def test_a_page_without_shapes_has_its_controls(open_page: OpenPage, tmp_path: Path) -> None:
    (tmp_path / "bare.urdf").write_text('<robot name="bare"><link name="base"/></robot>')
    with Viewer(tmp_path / "bare.urdf", port=0, whole_meshes=False) as viewer:
        viewer.button("greet", lambda: None)
        page = open_page(viewer.url)
        connected(viewer)
        page.page.get_by_text("greet").wait_for()
        assert not page.errors


def test_the_first_picture_of_a_robot_is_whole(open_page: OpenPage) -> None:
    model = dynx.load("ur5")
    with model.view(q=np.full(model.nq, 0.3), whole_meshes=False) as viewer:
        page = open_page()
        page.page.add_init_script(
            """
            window.widths = [];
            const draw = WebGL2RenderingContext.prototype.drawElements;
            WebGL2RenderingContext.prototype.drawElements = function (...given) {
              const box = this.canvas.getBoundingClientRect();
              if (window.widths.length < 2000) window.widths.push(this.drawingBufferWidth / box.width);
              return draw.apply(this, given);
            };
            """
        )
        page.go_to(viewer.url)
        until(lambda: page.page.evaluate("widths.length"), "a picture")
        page.page.wait_for_timeout(1500.0)
        assert min(page.page.evaluate("widths")) > MOVING + 0.1
