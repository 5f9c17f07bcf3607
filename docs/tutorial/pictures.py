"""Pictures of the tutorial: each step's program runs, and its variables are drawn.

python -m docs.tutorial pictures [STEP]
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import dynx
from docs.tutorial.pages import HOME, program
from dynx.world import Camera, Scene, SceneRobot, World, ground

BLUE, VERMILION, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#8c8c8c"

Variables = Mapping[str, Any]
"""Variables of a step's program after it has run."""


def draw(page: Path) -> None:
    """Run the program of a page, and draw its pictures into the folder of the page."""
    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = page.stem  # the same file at each run
    variables: dict[str, Any] = {"__name__": page.stem}
    home = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            exec(compile(program(page.read_text(encoding="utf-8")), page.name, "exec"), variables)
            for draw_one in PICTURES.get(page.stem, ()):
                draw_one(variables)
        finally:
            os.chdir(home)


def _arm(v: Variables) -> None:
    arm, q = v["arm"], v["q"]
    camera = Camera.look_at((1.25, -1.35, 0.95), (0.3, 0.05, 0.2), field_of_view=0.45, size=(800, 560))
    with World(Scene("arm", robots=(SceneRobot("ur5", arm, q=q),), bodies=(ground(),))) as world:
        picture = world.camera(camera)
    engine = dynx.backend("reference", arm)
    links = [arm.joint(name).child for name in arm.joint_names]
    _with_frames(picture, camera, engine.forward_kinematics(q, ["base_link", *links]), "1_arm.png")


def _with_frames(picture: Any, camera: Any, frames: Any, name: str, length: float = 0.12) -> None:
    """Write a picture of a camera with frames (4, 4) drawn over it."""
    height, width = picture.rgb.shape[:2]
    figure = plt.figure(figsize=(width / 100, height / 100), dpi=100)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.imshow(picture.rgb, extent=(0, width, height, 0))
    axes.axis("off")
    T_camera_world = np.linalg.inv(camera.pose.matrix)
    for T in frames:
        ends = T[:3, 3] + np.vstack([np.zeros(3), length * T[:3, :3].T])
        seen = (T_camera_world[:3, :3] @ ends.T).T + T_camera_world[:3, 3]
        pixels = seen @ np.asarray(camera.intrinsics).T
        pixels = pixels[:, :2] / pixels[:, 2:]
        for end, colour in zip(pixels[1:], (VERMILION, GREEN, BLUE), strict=True):
            arrow = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 0, "shrinkB": 0}
            axes.annotate("", end, pixels[0], arrowprops=arrow)
    axes.set(xlim=(0, width), ylim=(height, 0))
    figure.savefig(HOME / name, pil_kwargs={"optimize": True})
    plt.close(figure)


def _save(figure: Any, name: str) -> None:
    figure.savefig(HOME / name, bbox_inches="tight", metadata={"Date": None} if name.endswith("svg") else {})
    plt.close(figure)


def _frame(axes: Axes, origin: Any, angle: float, name: str, length: float = 0.14) -> None:
    """Draw a frame in the plane: x vermilion, y green."""
    for turn, colour, letter in ((0.0, VERMILION, "x"), (np.pi / 2, GREEN, "y")):
        tip = origin + length * np.array([np.cos(angle + turn), np.sin(angle + turn)])
        axes.annotate(
            "", tip, origin, arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0}
        )
        axes.text(*(origin + 1.18 * (tip - origin)), letter, color=colour, ha="center", va="center")
    corner = origin - 0.62 * length * np.array([np.cos(angle + np.pi / 4), np.sin(angle + np.pi / 4)])
    axes.text(*corner, name, ha="center", va="center", fontweight="bold")


def _links(axes: Axes, points: Any, colour: str = GREY, alpha: float = 1.0) -> None:
    """Draw the links between points, and a joint at each but the last."""
    points = np.asarray(points)
    axes.plot(*points.T, lw=9, color=colour, alpha=0.35 * alpha, solid_capstyle="round", zorder=1)
    axes.plot(*points[:-1].T, "o", ms=9, mfc="white", mec=colour, mew=2, alpha=alpha, zorder=2)


def _plain(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.axis("off")


PICTURES: dict[str, tuple[Callable[[Variables], None], ...]] = {"1_load_an_arm": (_arm,)}
