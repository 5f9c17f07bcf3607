"""Draw the pictures and films of docs/gallery.md, and write the page.

    python -m docs.gallery [NAME ...]      (all, or those named; needs the extras viewer, world and film)

Each picture is drawn by a function below, whose body the page shows beside it. The viewer draws them without
a browser and without a graphics processor.
"""

from __future__ import annotations

import ast
import inspect
import os
import re
import sys
import tempfile
import textwrap
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

import dynx
from dynx.model.geometry import HeightField
from dynx.viewer import Viewer
from dynx.world import Material, Scene, SceneBody, SceneRobot, TorqueMotor, World, ground, read_scene
from dynx.world.comparison import compare_engines

FOLDER = Path(__file__).parent / "gallery"

SIZE = (960, 720)
"""Width and height of the pictures [pixels]."""

FILM = (480, 360)
"""Width and height of the films [pixels]."""

QUALITY = 90
"""Quality of the pictures as WebP files, from 0 to 100."""

PICTURES: dict[str, tuple[str, str, Callable[[str], None]]] = {}
"""Title, sentence and function of each picture, by the name of its file."""


def picture(title: str, sentence: str, suffix: str = ".png") -> Callable[..., Callable[[str], None]]:
    """Add a picture that a function of the path draws."""

    def add(draw: Callable[[str], None]) -> Callable[[str], None]:
        PICTURES[draw.__name__ + suffix] = (title, sentence, draw)
        return draw

    return add


@picture("Arm", "A UR5 with a soft shadow, on a floor with tiles of 1 m and 0.2 m.")
def arm(path: str) -> None:
    q = [0.6, -1.2, 1.6, -2.0, -1.57, 0.3]
    with dynx.load("ur5").view(q=q, whole_meshes=True) as viewer:
        viewer.export(path, size=SIZE)


@picture("Humanoid", "Unitree's G1 with raised hands, seen almost from the front.")
def humanoid(path: str) -> None:
    model = dynx.load("g1", base="floating")
    q = model.neutral()
    angles = {"left_shoulder_roll_joint": 0.5, "right_shoulder_roll_joint": -0.5}
    angles |= {"left_elbow_joint": 0.2, "right_elbow_joint": 0.2, "left_knee_joint": 0.4}
    angles |= {"right_knee_joint": 0.4, "left_hip_pitch_joint": -0.2, "right_hip_pitch_joint": -0.2}
    for joint, angle in angles.items():
        q[7 + model.joint_names.index(joint)] = angle
    with model.view(q=q, whole_meshes=True) as viewer:
        viewer.export(path, size=SIZE, direction=(1.0, -0.55, 0.25))


@picture("Quadruped on a height field", "Motors hold a Unitree A1 in its standing posture on hills.")
def quadruped(path: str) -> None:
    x, y = np.meshgrid(np.linspace(-2.0, 2.0, 81), np.linspace(-2.0, 2.0, 81))
    steep = 0.035 + 0.1 * np.clip(np.hypot(x, y) - 0.35, 0.0, 1.0)
    heights = steep * np.sin(4.0 * x + 0.5) * np.cos(3.6 * y)
    hills = SceneBody(
        "hills",
        HeightField(tuple(map(tuple, heights.tolist())), (4.0, 4.0)),
        material=Material(friction=0.9, rgba=(0.47, 0.56, 0.36, 1.0)),
    )
    a1 = read_scene("standing").robots[0]
    with World(Scene("hills", bodies=[hills], robots=[a1]), "mujoco") as world:
        world.step(700)
        with world.view(steps=False, whole_meshes=True) as viewer:
            viewer.set_shown("contact forces", False)
            viewer.export(path, size=SIZE, direction=(1.0, -1.0, 0.45))


@picture("Stack", "The boxes of the scene `stack` after 0.3 s.")
def stack(path: str) -> None:
    with World(read_scene("stack"), "mujoco") as world:
        world.step(300)
        with world.view(steps=False) as viewer:
            viewer.set_shown("contact forces", False)
            viewer.export(path, size=SIZE)


@picture("Lander", "A lander descends to its pad between two flags on the Moon.")
def lander(path: str) -> None:
    with World(read_scene("landing"), "mujoco") as world, world.view(steps=False) as viewer:
        viewer.set_shown("contact forces", False)
        viewer.export(path, size=SIZE, direction=(0.5, -1.0, 0.3))


@picture("Cart-pole", "State feedback balances a pole, which starts 23 degrees from the vertical.", ".webp")
def cart_pole(path: str) -> None:
    robot = SceneRobot("cart_pole", dynx.load("cart_pole"), q=[0.0, 0.4])
    world = World(Scene("cart-pole", robots=[robot]), "mujoco")
    with world, world.view(steps=False) as viewer, viewer.record(path):
        for _ in range(60):
            state = world.state.robots["cart_pole"]
            force = [1.5, 30.0] @ np.array(state.q) + [3.0, 6.0] @ np.array(state.v)
            world.step(40, motors={"cart_pole": [TorqueMotor([force], joints=["slide"])]})
            viewer.update()


@picture("Gripper", "A Panda lifts a cube, which only friction holds in the gripper.", ".webp")
def gripper(path: str) -> None:
    run = compare_engines(read_scene("lifting"), ["mujoco"], duration=1.4)
    with Viewer(run, port=0) as viewer:
        viewer.export(path, size=FILM)


@picture("R2D2", "R2D2 from PyBullet's first example, in the colours of its URDF file.")
def r2d2(path: str) -> None:
    import pybullet_data

    model = dynx.load(os.path.join(pybullet_data.getDataPath(), "r2d2.urdf"))
    with model.view(whole_meshes=True) as viewer:
        viewer.export(path, size=SIZE, direction=(0.75, -1.0, 0.4))


@picture("Contacts", "Contact forces on the feet of a standing A1. The sum of the forces is its weight.")
def contacts(path: str) -> None:
    with World(read_scene("standing"), "mujoco") as world:
        world.step(1500)
        with world.view(steps=False, whole_meshes=True) as viewer:
            viewer.set_shown("force numbers")
            viewer.export(path, size=SIZE)


@picture(
    "Inertia ellipsoids",
    "Each ellipsoid on a Solo has uniform density, and the mass and inertia of its link.",
)
def inertia_ellipsoids(path: str) -> None:
    model = dynx.load("solo12", base="floating")
    q = np.concatenate([model.neutral()[:7], np.tile([0.0, 0.7, -1.4], 4)])
    with model.view(q=q, whole_meshes=True) as viewer:
        viewer.set_shown("inertia ellipsoids")
        viewer.export(path, size=SIZE)


@picture("Frames", "The link frames of a see-through Panda: x is red, y is green and z is blue.")
def frames(path: str) -> None:
    with dynx.load("panda").view(q=[0, -0.5, 0, -2.1, 0, 1.6, 0.8, 0.02], whole_meshes=True) as viewer:
        viewer.set_shown("frames")
        viewer.set_opacity(0.5)
        viewer.export(path, size=SIZE)


@picture(
    "Two engines",
    "A ball hits pins. PyBullet's result is solid, MuJoCo's result is see-through and blue.",
    ".webp",
)
def two_engines(path: str) -> None:
    run = compare_engines(read_scene("bowling"), ["pybullet", "mujoco"], duration=1.2, samples=60)
    with Viewer(run, port=0) as viewer:
        viewer.export(path, size=FILM, direction=(-0.7, -1.0, 0.7))


@picture(
    "Gravity torques",
    "The numbers are the torques against gravity. The length of each arrow is the torque divided by its "
    "limit.",
)
def gravity_torques(path: str) -> None:
    with dynx.load("panda").view(q=[0, 0.5, 0, -1.6, 0, 2.1, 0.8, 0.02], whole_meshes=True) as viewer:
        viewer.set_shown("gravity torques")
        viewer.export(path, size=SIZE)


@picture(
    "Manipulability", "The ellipsoid shows the velocities of the flange for all joint velocities of norm 1."
)
def manipulability(path: str) -> None:
    with dynx.load("ur5").view(q=[0.6, -0.9, 1.2, -1.8, -1.57, 0.3], whole_meshes=True) as viewer:
        viewer.set_shown("manipulability")
        viewer.export(path, size=SIZE)


@picture(
    "Collision shapes",
    "Engines use these convex hulls for collisions of a Panda. They are drawn over its visual shapes.",
)
def collision_shapes(path: str) -> None:
    with dynx.load("panda").view(q=[0, -0.5, 0, -2.1, 0, 1.6, 0.8, 0.02], whole_meshes=True) as viewer:
        viewer.set_shown("collision shapes")
        viewer.export(path, size=SIZE)


@picture("Names", "Names of the links of a hand. The viewer leaves out names that would overlap other names.")
def names(path: str) -> None:
    with dynx.load("allegro_right_hand").view(whole_meshes=True) as viewer:
        viewer.set_shown("names")
        viewer.export(path, size=SIZE, direction=(1.0, 0.4, 0.4))


@picture("A path", "A falling double pendulum. The program draws the path of the tip as a line.", ".webp")
def path_of_a_tip(path: str) -> None:
    rollout = dynx.simulate(
        dynx.load("dynx_double_pendulum", base_pose=dynx.Pose((0.0, 0.0, 2.2))),
        None,
        q0=[2.6, 0.6],
        duration=2.0,
        joint_damping=False,
    )
    with dynx.backend("reference", rollout.model) as engine:
        poses = [engine.forward_kinematics(q, rollout.model.frame_names[-1]) for q in rollout.q[::20]]
    points = [pose[:3, 3] for pose in poses]
    with rollout.view() as viewer:
        viewer.line(points, colour="vermilion", thickness=0.01)
        viewer.export(path, size=FILM, direction=(0.4, -1.0, 0.15))


@picture("Dark", "Talos on a dark background. `dark=True` works for pages, pictures and films.")
def dark(path: str) -> None:
    with dynx.load("talos").view(dark=True, whole_meshes=True) as viewer:
        viewer.export(path, size=SIZE, direction=(1.0, -0.6, 0.3))


@picture("Many robots", "Nine Solos in one scene.")
def many_robots(path: str) -> None:
    model = dynx.load("solo12", base="floating")
    rng = np.random.default_rng(3)
    robots = []
    for k in range(9):
        q = model.neutral()
        q[:3] = 0.7 * (k % 3), 0.7 * (k // 3), 0.34
        q[7:] = np.tile([0.0, 0.7, -1.4], 4) + 0.15 * rng.standard_normal(12)
        robots.append(SceneRobot(f"solo{k}", model, q=q))
    world = World(Scene("solos", bodies=[ground()], robots=robots), "mujoco")
    with world, world.view(steps=False) as viewer:
        viewer.export(path, size=SIZE)


@picture("A duck", "A mesh with an image as its texture. Engines use its convex hull for contacts.")
def duck(path: str) -> None:
    with World(read_scene("duck"), "mujoco") as world:
        world.step(300)
        with world.view(steps=False, whole_meshes=True) as viewer:
            viewer.set_shown("contact forces", False)
            viewer.export(path, size=SIZE)


@picture("Mobile robot", "TIAGo. The program adds the text.")
def mobile_robot(path: str) -> None:
    with dynx.load("tiago").view(whole_meshes=True) as viewer:
        viewer.text("TIAGo", (0.35, 0.4, 0.9), colour="blue", size=26)
        viewer.export(path, size=SIZE, direction=(1.0, -0.8, 0.35))


HEAD = """# Gallery

The program below each picture or film made it. The programs need the extras `viewer`, `world`, `film` and
`mujoco`, but no browser and no graphics processor. A program takes up to two minutes. In a clone of dynx,
`python -m docs.gallery` runs all programs.

`dynx play` also shows Gymnasium's own lander (extra `train`). The lander is not on this page, because
Gymnasium draws its pictures itself.
"""


def page() -> str:
    """Return docs/gallery.md."""
    parts = [HEAD]
    for name, (title, sentence, draw) in PICTURES.items():
        lines = inspect.getsource(draw).splitlines()
        start = next(k for k, line in enumerate(lines) if line.startswith("def ")) + 1
        body = textwrap.dedent("\n".join(lines[start:]))
        file = f"gallery/{Path(name).stem}.webp"
        shown = f"![{title}: {sentence}]({file})"
        code = f"```python\n{first_lines(body, name)}\n{body}\n```"
        parts.append(f"## {title}\n\n{sentence}\n\n{shown}\n\n{code}\n")
    return "\n".join(parts)


def first_lines(code: str, file: str) -> str:
    """Return the imports of this module that code needs, the sizes, and the path of its file."""
    words = set(re.findall(r"\w+", code))
    lines: dict[bool, list[str]] = {False: [], True: []}
    for node in ast.parse(Path(__file__).read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            node.names = [each for each in node.names if (each.asname or each.name) in words]
            if node.names:
                line = ast.unparse(node)
                lines["dynx" in line].append(line)
    sizes = [f"{name} = {value}" for name, value in (("SIZE", SIZE), ("FILM", FILM)) if name in words]
    settings = [*sizes, f'path = "{file}"']
    return "\n\n".join("\n".join(part) for part in (lines[False], lines[True], settings) if part)


def write(name: str) -> None:
    """Draw one picture, and write it to the folder."""
    target = FOLDER / f"{Path(name).stem}.webp"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        PICTURES[name][2](str(file))
        if name.endswith(".png"):
            Image.open(file).save(target, quality=QUALITY, method=6)
        else:
            target.write_bytes(file.read_bytes())
    print(f"{target.name}: {target.stat().st_size / 1e3:.0f} kB", flush=True)


def main(names: list[str]) -> None:
    """Draw the pictures named, or all, and write the page."""
    FOLDER.mkdir(exist_ok=True)
    chosen = [name for name in PICTURES if not names or Path(name).stem in names]
    for name in chosen:
        write(name)
    (FOLDER.parent / "gallery.md").write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
