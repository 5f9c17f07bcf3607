"""Pictures of the tutorial: each step's program runs, and its variables are drawn.

python -m docs.tutorial pictures [STEP]
"""

from __future__ import annotations

import json
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
from dynx.viewer import Viewer
from dynx.world import Camera, ExternalForce, Scene, SceneRobot, World, ground

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


def _planar_frames(v: Variables) -> None:
    q = np.array([0.5, 0.8])
    _, elbow, tip = _planar(q)
    figure, axes = plt.subplots(figsize=(6.4, 5.2))
    _links(axes, [np.zeros(2), elbow, tip])
    axes.plot([0, 0.36], [0, 0], [elbow[0], 1.6 * elbow[0]], [elbow[1], 1.6 * elbow[1]], ls=":", color=GREY)
    _angle(axes, np.zeros(2), 0.0, q[0], 0.3, "$q_1$")
    _angle(axes, elbow, q[0], q.sum(), 0.2, "$q_2$")
    _frame(axes, np.zeros(2), 0.0, "0", side=-0.75 * np.pi, length=0.12, dashed=True)
    _frame(axes, np.zeros(2), q[0], "1", side=0.75 * np.pi, length=0.17)
    _frame(axes, elbow, q.sum(), "2", side=-0.25 * np.pi)
    _frame(axes, tip, q.sum(), "T", side=-0.3 * np.pi)
    for start, end, name in ((np.zeros(2), elbow, "$l_1$"), (elbow, tip, "$l_2$")):
        along = (end - start) / np.linalg.norm(end - start)
        axes.text(*(0.5 * (start + end) + 0.05 * np.array([-along[1], along[0]])), name)
    _plain(axes)
    _save(figure, "2_frames.svg")


def _workspace(v: Variables) -> None:
    points = v["points"]
    figure, panels = plt.subplots(1, 2, figsize=(9, 4.4))
    radius = np.hypot(points[:, 0], points[:, 1])
    panels[0].plot(radius, points[:, 2], ".", ms=1.5, color=BLUE)
    panels[0].set(title="height over the distance from the axis of the base", xlabel="distance [m]")
    panels[0].set(ylabel="z [m]", xlim=(0, 1))
    middle = points[radius < 0.25]
    panels[1].plot(middle[:, 0], middle[:, 1], ".", ms=1.5, color=BLUE)
    panels[1].set(title="the middle, from above", xlabel="x [m]", ylabel="y [m]")
    for axes in panels:
        axes.set_aspect("equal")
        axes.title.set_fontsize(9)
    figure.tight_layout()
    _save(figure, "2_workspace.png")


def _two_solutions(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(5.6, 4.2))
    target = np.array([v["x"], v["y"]])
    for (q1, q2), colour, name in zip(v["both"], (BLUE, VERMILION), ("elbow down", "elbow up"), strict=True):
        points = _planar((q1, q2))
        _links(axes, points, colour)
        side = np.array([0.0, -0.07 if q2 > 0 else 0.05])
        axes.text(*(points[1] + side), name, color=colour, ha="center")
    axes.plot([0, target[0]], [0, target[1]], "--", color=GREY, lw=1)
    axes.text(0.5 * target[0] + 0.02, 0.5 * target[1] - 0.03, "$r$")
    axes.plot(*target, "*", ms=16, color=GREEN)
    axes.text(target[0] + 0.03, target[1], "target $(x, y)$", va="center")
    _plain(axes)
    _save(figure, "3_two_solutions.svg")


def _solutions(v: Variables) -> None:
    arm, solutions = v["arm"], v["every"].q
    chosen = [int(np.abs(solutions[:, 0] - solutions[0, 0]).argsort()[i]) for i in range(2)]
    chosen += [int(np.abs(solutions[:, 0] - solutions[0, 0]).argsort()[-1 - i]) for i in (0, 3)]
    camera = Camera.look_at((1.5, -1.1, 1.0), (0.2, 0.05, 0.3), field_of_view=0.46, size=(420, 420))
    figure, panels = plt.subplots(1, 4, figsize=(12.6, 3.2))
    for axes, index in zip(panels, chosen, strict=True):
        robot = SceneRobot("ur5", arm, q=solutions[index])
        with World(Scene("arm", robots=(robot,), bodies=(ground(),)), collisions=False) as world:
            axes.imshow(world.camera(camera).rgb)
        axes.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0.02, 0)
    _save(figure, "3_solutions.png")


def _planar(q: Any, lengths: tuple[float, float] = (0.5, 0.4)) -> Any:
    """Return base, elbow and tip (3, 2) of the planar arm."""
    elbow = lengths[0] * np.array([np.cos(q[0]), np.sin(q[0])])
    tip = elbow + lengths[1] * np.array([np.cos(q[0] + q[1]), np.sin(q[0] + q[1])])
    return np.array([np.zeros(2), elbow, tip])


def _arrow(axes: Axes, start: Any, end: Any, colour: str, name: str = "", **style: Any) -> None:
    """Draw an arrow with its name at the head."""
    arrow = {"arrowstyle": "-|>", "color": colour, "lw": 2.2, "shrinkA": 0, "shrinkB": 0} | style
    axes.annotate("", end, start, arrowprops=arrow, annotation_clip=False)
    along = (np.asarray(end) - start) / np.linalg.norm(np.asarray(end) - start)
    head = end + 0.04 * along
    across = "center" if abs(along[0]) < 0.6 else "right" if along[0] < 0 else "left"
    axes.text(*head, name, color=colour, ha=across, va="top" if along[1] < -0.6 else "center")
    axes.plot(*head, alpha=0)  # the picture contains the name


def _columns(v: Variables) -> None:
    points = _planar([0.4, 1.0])
    figure, axes = plt.subplots(figsize=(5.4, 4.4))
    _links(axes, points)
    J = v["by_hand"]
    for joint, colour in ((0, BLUE), (1, VERMILION)):
        axes.plot(*points[[joint, 2]].T, ":", color=colour, lw=1.4)
        _arrow(axes, points[2], points[2] + 0.6 * J[:, joint], colour, f"column {joint + 1}")
    axes.text(points[0, 0], points[0, 1] - 0.06, "shoulder", color=BLUE, ha="center")
    axes.text(points[1, 0] + 0.09, points[1, 1] - 0.03, "elbow", color=VERMILION, ha="center")
    _plain(axes)
    _save(figure, "4_columns.svg")


def _ellipses(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(8.4, 3.2))
    engine = dynx.backend("reference", v["planar"])
    circle = np.array([[np.cos(t), np.sin(t)] for t in np.linspace(0, 2 * np.pi, 200)])
    for place, (elbow, colour) in enumerate(((1.8, GREEN), (0.9, BLUE), (0.15, VERMILION))):
        q = np.array([0.9 - elbow / 2, elbow])
        J = engine.jacobian(q, "tip")[:2]
        points = _planar(q) + np.array([1.1 * place, 0.0])
        _links(axes, points)
        ellipse = points[2] + 0.25 * circle @ J.T
        axes.fill(*ellipse.T, color=colour, alpha=0.35)
        axes.text(1.1 * place + 0.1, -0.16, f"elbow {elbow} rad", color=colour)
    _plain(axes)
    _save(figure, "4_ellipses.svg")


def _rod(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(4.6, 4.4))
    q, length = 0.7, 0.5
    end = length * np.array([np.sin(q), -np.cos(q)])
    _links(axes, [np.zeros(2), end])
    axes.plot([0, 0], [0, -0.55], ":", color=GREY)
    _angle(axes, np.zeros(2), -np.pi / 2, -np.pi / 2 + q, 0.17, "$q$")
    centre = 0.5 * end
    axes.plot(*centre, "o", color="black")
    _arrow(axes, centre, (centre[0], centre[1] - 0.22), VERMILION, "$m g$")
    axes.plot([0, centre[0]], [0.06, 0.06], color=BLUE, lw=1.5, marker="|")
    axes.plot([centre[0]] * 2, [0.06, centre[1]], ":", color=BLUE)
    axes.text(centre[0] / 2, 0.085, "lever arm $c\\,\\sin q$", color=BLUE, ha="center")
    axes.text(0.6 * centre[0] + 0.045, 0.6 * centre[1] + 0.02, "$c$", ha="center")
    turn = np.linspace(0.75 * np.pi, 1.4 * np.pi, 40)
    axes.plot(0.09 * np.cos(turn), 0.09 * np.sin(turn), color=GREEN, lw=2)
    _arrow(axes, 0.09 * np.array([np.cos(turn[-2]), np.sin(turn[-2])]), [-0.026, -0.09], GREEN)
    axes.text(-0.13, 0.0, r"$\tau$", color=GREEN, fontsize=13)
    _plain(axes)
    _save(figure, "5_rod.svg")


def _swings(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(8.4, 3.0))
    t = v["h"] * np.arange(1, 10_001)
    for (name, angles), colour in zip(v["swings"].items(), (GREY, VERMILION, None, BLUE), strict=True):
        if colour:
            axes.plot(t[::10], angles[::10], color=colour, label=name)
    axes.set(xlabel="time [s]", ylabel="angle [rad]", xlim=(0, 10), ylim=(-1.15, 1.75))
    axes.legend(frameon=False, ncols=3, loc="upper center")
    axes.spines[["top", "right"]].set_visible(False)
    _save(figure, "5_swings.svg")


def _cycloid(v: Variables) -> None:
    t = np.linspace(0.0, 2.0, 401)
    figure, panels = plt.subplots(3, 1, figsize=(7.2, 5.0), sharex=True)
    setpoint = v["motion"](t)
    rows = zip(panels, setpoint, ("position [rad]", "speed [rad/s]", "acceleration [rad/s²]"), strict=True)
    for axes, values, name in rows:
        axes.plot(t, values[:, 2], color=BLUE, label="cycloid")
        axes.set_ylabel(name, fontsize=9)
        axes.spines[["top", "right"]].set_visible(False)
    jump = [0.0, 0.0, 1.0, 1.0]
    panels[0].plot([-0.2, 0.0, 0.0, 2.0], jump, "--", color=VERMILION, label="jump")
    for axes, low, high in ((panels[1], 0.0, 1.0), (panels[2], -1.6, 1.6)):
        _arrow(axes, (0.0, 0.0), (0.0, high), VERMILION, lw=1.5, ls="--")
        if low:
            _arrow(axes, (0.0, 0.0), (0.0, low), VERMILION, lw=1.5, ls="--")
        axes.text(0.03, 0.88 * (low or high), "without bound", color=VERMILION, fontsize=8)
    panels[0].legend(frameon=False, loc="lower right")
    panels[2].set(xlabel="time [s]", xlim=(-0.2, 2.0))
    figure.align_ylabels()
    _save(figure, "6_cycloid.svg")


def _paths(v: Variables) -> None:
    figure, panels = plt.subplots(1, 2, figsize=(8.4, 3.6))
    views = ((0, 1, "from above"), (1, 2, "from the side"))
    for axes, (across, up, name) in zip(panels, views, strict=True):
        for path, colour in (("line", BLUE), ("joints", VERMILION)):
            points = v["paths"][path]
            axes.plot(points[:, across], points[:, up], color=colour, label=path)
        axes.plot(*v["ends"][:, [across, up]].T, "o", color="black", ms=4)
        axes.set(xlabel=f"{'xyz'[across]} [m]", ylabel=f"{'xyz'[up]} [m]", title=name)
        axes.title.set_fontsize(10)
        axes.set_aspect("equal", adjustable="datalim")
        axes.spines[["top", "right"]].set_visible(False)
    panels[0].legend(frameon=False)
    figure.tight_layout()
    _save(figure, "6_paths.svg")


def _loop(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(8.2, 2.4))
    boxes = {"trajectory": (0.0, BLUE), "controller": (3.2, VERMILION), "arm": (6.4, GREEN)}
    for name, (x, colour) in boxes.items():
        axes.add_patch(plt.Rectangle((x, 0), 1.7, 0.9, fc="none", ec=colour, lw=2))
        axes.text(x + 0.85, 0.45, name, ha="center", va="center", color=colour, fontsize=12)
    for x, name in ((1.7, r"$q^*, \dot q^*, \ddot q^*$"), (4.9, r"torques $\tau$")):
        _arrow(axes, (x, 0.45), (x + 1.5, 0.45), "black", lw=1.5)
        axes.text(x + 0.72, 0.58, name, ha="center")
    axes.plot([7.25, 7.25, 4.05], [0, -0.75, -0.75], color="black", lw=1.5)
    _arrow(axes, (4.05, -0.75), (4.05, 0.0), "black", lw=1.5)
    axes.text(5.65, -0.62, r"measured $q, \dot q$", ha="center")
    axes.set(xlim=(-0.1, 8.2), ylim=(-0.9, 1.0))
    _plain(axes)
    _save(figure, "7_loop.svg")


def _errors(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(8.0, 3.4))
    for (name, rollout), colour in zip(v["rollouts"].items(), (VERMILION, GREEN, BLUE), strict=True):
        error = np.abs(rollout.error).max(axis=1)
        axes.semilogy(rollout.t[10 : len(error) : 5], error[10::5], color=colour)
        axes.text(2.02, error[-1], name, color=colour, va="center")
    axes.set(xlabel="time [s]", ylabel="largest error of a joint [rad]", xlim=(0, 2), ylim=(1e-6, 0.2))
    axes.spines[["top", "right"]].set_visible(False)
    _save(figure, "7_errors.svg")


def _motion(v: Variables) -> None:
    with Viewer((v["rollouts"]["computed torque"], v["heavy"]["PD"])) as viewer:
        viewer.export(HOME / "7_motion.gif")


def _box(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(5.6, 3.0))
    axes.plot([-0.5, 0.7], [0, 0], color=GREY, lw=3)
    axes.add_patch(plt.Rectangle((-0.2, 0), 0.4, 0.2, fc="#dddddd", ec=GREY, lw=1.5))
    _arrow(axes, (0.0, 0.1), (0.0, -0.2), VERMILION, "weight $m g$")
    _arrow(axes, (0.0, 0.0), (0.0, 0.32), BLUE, "normal force $N$")
    _arrow(axes, (-0.02, 0.0), (-0.32, 0.0), GREEN)
    axes.text(-0.36, 0.05, r"friction $\mu N$", color=GREEN, ha="center")
    _arrow(axes, (0.25, 0.1), (0.45, 0.1), "black", "speed $v$")
    _plain(axes)
    _save(figure, "8_box.svg")


def _camera(v: Variables) -> None:
    picture = v["picture"]
    figure, panels = plt.subplots(1, 3, figsize=(10.8, 3.0))
    panels[0].imshow(picture.rgb)
    near = np.where(np.isfinite(picture.depth), picture.depth, np.nan)
    panels[1].imshow(near, cmap="viridis_r", vmin=2.5, vmax=8.0)
    parts = np.array(picture.segmentation, dtype=float)
    parts[~picture.mask("r2d2")] = np.nan
    panels[2].imshow(np.full((*parts.shape, 3), 0.93))
    panels[2].imshow(parts, cmap="tab20", interpolation="nearest")
    for axes in panels:
        axes.axis("off")
    figure.subplots_adjust(0, 0, 1, 1, 0.02, 0)
    _save(figure, "8_camera.png")


def _push(v: Variables) -> None:
    with World(v["rolling"], "pybullet", dt=2e-3) as world, world.view(steps=False) as viewer:
        world.run(2.5)
        with viewer.record(HOME / "8_push.gif"):
            for step in range(22):
                push = ExternalForce("r2d2/head", (0, 300.0, 0, 0, 0, 0))
                world.run(0.1, forces=[push] if step in (5, 6) else [])
                viewer.update()


def _cart_pole(v: Variables) -> None:
    figure, axes = plt.subplots(figsize=(6.0, 3.4))
    axes.plot([-1.1, 1.3], [0, 0], color=GREY, lw=2)
    axes.add_patch(plt.Rectangle((0.1, 0.02), 0.5, 0.24, fc="#dddddd", ec=GREY, lw=1.5))
    hinge = np.array([0.35, 0.14])
    tip = hinge + 0.75 * np.array([np.sin(0.3), np.cos(0.3)])
    axes.plot(*np.array([hinge, tip]).T, lw=8, color=BLUE, alpha=0.5, solid_capstyle="round")
    axes.plot(*hinge, "o", ms=8, mfc="white", mec=BLUE, mew=2)
    axes.plot([hinge[0]] * 2, [hinge[1], 0.95], ":", color=GREY)
    _angle(axes, hinge, np.pi / 2 - 0.3, np.pi / 2, 0.5, "")
    axes.text(hinge[0] + 0.07, 0.7, r"$\theta$")
    _frame(axes, np.array([-0.7, 0.0]), 0.0, "0", side=-0.7 * np.pi, length=0.25)
    _arrow(axes, (-0.7, -0.12), (hinge[0], -0.12), "black", lw=1.3)
    axes.text(-0.15, -0.21, "$x$", ha="center")
    _arrow(axes, (0.6, 0.14), (0.95, 0.14), VERMILION, "right", lw=2.2)
    _arrow(axes, (0.1, 0.14), (-0.22, 0.14), VERMILION, "left", lw=2.2)
    _plain(axes)
    _save(figure, "9_cart_pole.svg")


def _curve(v: Variables) -> None:
    lines = Path("cart_pole/curve.jsonl").read_text(encoding="utf-8").splitlines()
    points = [json.loads(line) for line in lines]
    figure, axes = plt.subplots(figsize=(7.2, 3.0))
    axes.plot([each["steps"] for each in points], [each["mean_return"] for each in points], color=BLUE)
    axes.axhline(500, ls=":", color=GREY)
    axes.set(xlabel="steps", ylabel="mean return of the last 100 episodes", ylim=(0, 520))
    axes.yaxis.label.set_fontsize(8)
    axes.spines[["top", "right"]].set_visible(False)
    _save(figure, "9_curve.svg")


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


def _frame(
    axes: Axes,
    origin: Any,
    angle: float,
    name: str,
    *,
    side: float,
    length: float = 0.14,
    dashed: bool = False,
) -> None:
    """Draw a frame in the plane, x vermilion and y green, with its name in the direction `side` from x."""
    for turn, colour, letter in ((0.0, VERMILION, "x"), (np.pi / 2, GREEN, "y")):
        tip = origin + length * np.array([np.cos(angle + turn), np.sin(angle + turn)])
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 2, "shrinkA": 0, "shrinkB": 0}
        style = {"ls": "--", "lw": 1.4} if dashed else {}
        axes.annotate("", tip, origin, arrowprops=arrow | style, annotation_clip=False)
        axes.plot(*(origin + 1.2 * (tip - origin)), alpha=0)  # the picture contains the letter
        axes.text(*(origin + 1.16 * (tip - origin)), letter, color=colour, ha="center", va="center")
    corner = origin + 0.055 * np.array([np.cos(angle + side), np.sin(angle + side)])
    axes.text(*corner, name, ha="center", va="center", fontweight="bold")


def _angle(axes: Axes, centre: Any, start: float, end: float, radius: float, name: str) -> None:
    """Draw an arc from one direction to another, with the name of the angle."""
    turns = np.linspace(start, end, 40)
    axes.plot(centre[0] + radius * np.cos(turns), centre[1] + radius * np.sin(turns), color="black", lw=1)
    middle = 0.5 * (start + end)
    axes.text(*(centre + 1.14 * radius * np.array([np.cos(middle), np.sin(middle)])), name, va="center")


def _links(axes: Axes, points: Any, colour: str = GREY, alpha: float = 1.0) -> None:
    """Draw the links between points, and a joint at each but the last."""
    points = np.asarray(points)
    axes.plot(*points.T, lw=9, color=colour, alpha=0.35 * alpha, solid_capstyle="round", zorder=1)
    axes.plot(*points[:-1].T, "o", ms=9, mfc="white", mec=colour, mew=2, alpha=alpha, zorder=2)


def _plain(axes: Axes) -> None:
    axes.set_aspect("equal")
    axes.axis("off")


PICTURES: dict[str, tuple[Callable[[Variables], None], ...]] = {
    "1_load_an_arm": (_arm,),
    "2_forward_kinematics": (_planar_frames, _workspace),
    "3_inverse_kinematics": (_two_solutions, _solutions),
    "4_jacobian": (_columns, _ellipses),
    "5_dynamics": (_rod, _swings),
    "6_trajectory": (_cycloid, _paths),
    "7_control": (_loop, _errors, _motion),
    "8_worlds": (_box, _camera, _push),
    "9_learning": (_cart_pole, _curve),
}
