"""Friction and restitution as they act: measured by sliding bodies and by dropping them.

``python -m tests.world.materials`` prints the tables of docs/explanation/what-engines-do-differently.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import dynx
from dynx import Pose
from dynx.model.geometry import Capsule, Collision, Mesh, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, SceneRobot, World, box, ground
from tests.world.engines import WORLDS

G = 9.81
SPEED = 3.0
SIZE = (0.4, 0.4, 0.1)

SLIDERS = ("box", "mesh", "link", "box on a box", "box on a link")
"""Bodies that slide, on the ground unless it is named."""


def slab_mesh(folder: Path) -> Shape:
    """Return the box of `SIZE` as a mesh."""
    corners = [(x, y, z) for x in (-0.2, 0.2) for y in (-0.2, 0.2) for z in (-0.05, 0.05)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
    file = folder / "slab.obj"
    file.write_text("\n".join([*lines, *(f"f {face}" for face in faces), ""]))
    return Mesh(str(file))


def slab_robot(size: tuple[float, ...], base: str) -> dynx.Model:
    """Return a robot of one link, a box."""
    geometry = f'<geometry><box size="{" ".join(map(str, size))}"/></geometry>'
    inertia = '<inertia ixx="0.03" iyy="0.03" izz="0.05" ixy="0" ixz="0" iyz="0"/>'
    return dynx.load(
        f'<robot name="slab"><link name="slab"><inertial><mass value="2"/>{inertia}</inertial>'
        f"<collision>{geometry}</collision></link></robot>",
        base=base,  # type: ignore[arg-type]
    )


def sliding_scene(
    kind: str, a: Material, b: Material, folder: Path, speed: float, gravity: tuple[float, float, float]
) -> Scene:
    """Return a slab of material `a` at the height 0 that moves along x, on a surface of material `b`."""
    pose, twist = Pose((0, 0, 0.05)), (speed, 0, 0, 0, 0, 0)
    bodies, robots = [], []
    if kind == "link":
        robot = slab_robot(SIZE, "floating")
        robots.append(
            SceneRobot("slider", robot, q=(0, 0, 0.05, 0, 0, 0, 1), v=tuple(map(float, twist)), material=a)
        )
    elif kind == "mesh":
        shape = Collision(slab_mesh(folder))
        bodies.append(SceneBody("slider", (shape,), pose, 2.0, twist=twist, material=a))
    else:
        bodies.append(box("slider", SIZE, mass=2.0, pose=pose, twist=twist, material=a))
    under = Pose((0, 0, -0.5))
    if kind == "box on a box":
        bodies.append(box("ground", (20, 20, 1), pose=under, material=b))
    elif kind == "box on a link":
        table = slab_robot((20, 20, 1), "fixed").with_base_pose(under)
        robots.append(SceneRobot("ground", table, material=b))
    else:
        bodies.append(ground(material=b))
    return Scene("sliding", robots=tuple(robots), bodies=tuple(bodies), gravity=gravity)


def velocity(world: World) -> Floats:
    """Return the linear velocity (3,) of the slider."""
    state = world.state
    return (state.bodies["slider"].twist if "slider" in state.bodies else state.robots["slider"].v)[:3]


def sliding_friction(kind: str, engine: str, a: Material, b: Material, folder: Path) -> float:
    """Return the mean deceleration of a slab that slides on a level ground, in units of gravity."""
    scene = sliding_scene(kind, a, b, folder, SPEED, (0, 0, -G))
    expected = np.sqrt(a.friction * b.friction) * G
    with World(scene, engine) as world:
        world.run(0.02)
        before, time = velocity(world)[0], world.time
        world.run(min(0.6, 0.7 * SPEED / max(expected, 0.1)))
        return float((before - velocity(world)[0]) / (world.time - time) / G)


def speed_on_slope(kind: str, engine: str, a: Material, b: Material, tangent: float, folder: Path) -> float:
    """Return the speed of a slab after 0.4 s on a slope, relative to that without friction."""
    angle = np.arctan(tangent)
    gravity = (float(G * np.sin(angle)), 0.0, float(-G * np.cos(angle)))
    with World(sliding_scene(kind, a, b, folder, 0.0, gravity), engine) as world:
        world.run(0.4)
        return float(velocity(world)[0] / (0.4 * G * np.sin(angle)))


def four_materials() -> Scene:
    """Return slabs of three materials that slide side by side on a ground of another."""
    slabs = [
        box(
            f"slab{k}",
            (0.4, 0.4, 0.1),
            mass=2.0,
            pose=Pose((0, 2.0 * k, 0.05)),
            twist=(3, 0, 0, 0, 0, 0),
            material=Material(friction=friction),
        )
        for k, friction in enumerate((0.1, 0.4, 0.9))
    ]
    return Scene("slabs", bodies=(ground(material=Material(friction=0.25)), *slabs))


def dropping_scene(kind: str, a: Material, b: Material, height: float, folder: Path) -> tuple[Scene, float]:
    """Return a body of material `a` at a height above a ground of material `b`, and the height of its centre
    when it touches."""
    bodies, robots = [ground(material=b)], []
    if kind == "link":
        half = 0.05
        q = (0, 0, half + height, 0, 0, 0, 1)
        robots.append(SceneRobot("slider", slab_robot(SIZE, "floating"), q=q, material=a))
    else:
        half = 0.05 if kind in ("box", "mesh") else 0.1
        rpy = (float(np.pi / 2), 0.0, 0.0) if kind == "capsule" else (0.0, 0.0, 0.0)
        pose = Pose((0, 0, half + height), rpy)
        shapes: dict[str, Shape] = {"ball": Sphere(0.1), "capsule": Capsule(0.1, 0.3)}
        if kind == "box":
            bodies.append(box("slider", SIZE, mass=2.0, pose=pose, material=a))
        else:
            shape = slab_mesh(folder) if kind == "mesh" else shapes[kind]
            bodies.append(SceneBody("slider", (Collision(shape),), pose, 2.0, material=a))
    return Scene("dropping", robots=tuple(robots), bodies=tuple(bodies)), half


def rebound(
    kind: str, engine: str, a: Material, b: Material, folder: Path, dt: float = 1e-3, height: float = 1.0
) -> float:
    """Return the height to which a body rebounds after a fall, relative to that of the fall."""
    scene, half = dropping_scene(kind, a, b, height, folder)
    fall = float(np.sqrt(2.0 * height / G))
    with World(scene, engine, dt) as world:
        world.run(0.98 * fall)
        heights = []
        for _ in range(int(1.4 * fall / dt)):
            world.step()
            state = world.state
            body, robot = state.bodies.get("slider"), state.robots.get("slider")
            heights.append((robot.q[2] if body is None else body.T_world_body[2, 3]) - half)  # type: ignore[union-attr]
            # Until it falls again.
            if len(heights) > 2 and heights[-3] < heights[-2] > heights[-1] and heights[-1] > 0.0:
                break
    lowest = int(np.argmin(heights))
    return float(max(heights[lowest:]) / height)


def mean_rebound(kind: str, engine: str, a: Material, b: Material, folder: Path, dt: float = 1e-3) -> Floats:
    """Return mean and largest deviation from it of rebounds after falls from heights near 1 m.

    A body meets the surface at a random part of a step, so that single rebounds differ.
    """
    heights = (0.97, 0.98, 0.99, 1.0, 1.01, 1.02)
    drops = np.array([rebound(kind, engine, a, b, folder, dt, height) for height in heights])
    mean = float(np.mean(drops))
    return np.array([mean, float(abs(drops - mean).max())])


def main() -> None:
    """Print the tables."""
    coefficients = (0.0, 0.1, 0.5, 1.5)
    print(
        "| friction of the two surfaces | geometric mean (expected) | "
        + " | ".join(WORLDS)
        + " |\n"
        + "|---|---|"
        + "---|" * len(WORLDS)
    )
    for k, a in enumerate(coefficients):
        for b in coefficients[k:]:
            row = [f"{a:g}, {b:g}", f"{np.sqrt(a * b):.4f}"]
            for engine in WORLDS:
                found = sliding_friction("box", engine, Material(friction=a), Material(friction=b), Path())
                row.append(f"{found:.4f}")
            print("| " + " | ".join(row) + " |")
    engines = ("pybullet", "mujoco")
    steps = (4e-3, 2e-3, 1e-3)
    heads = [f"{engine}, {1e3 * dt:g} ms" for engine in engines for dt in steps]
    print(
        "\n| restitution of the two surfaces | expected height | "
        + " | ".join(heads)
        + " |\n|---|---|"
        + "---|" * len(heads)
    )
    for one, other in ((0.0, 1.0), (0.2, 0.2), (0.25, 1.0), (0.8, 0.8), (1.0, 1.0)):
        row = [f"{one:g}, {other:g}", f"{one * other:.3f}"]
        for engine in engines:
            for dt in steps:
                surfaces = Material(restitution=one), Material(restitution=other)
                mean, spread = mean_rebound("ball", engine, *surfaces, Path(), dt)
                row.append(f"{abs(mean):.3f} ± {spread:.3f}")
        print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
