"""Friction and restitution as they act: measured by sliding bodies and by dropping them.

``python -m tests.world.materials`` prints the tables of docs/world.md.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import dynx
from dynx import Pose
from dynx.model.geometry import Collision, Mesh, Shape
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


def main() -> None:
    """Print the tables."""
    coefficients = (0.0, 0.1, 0.5, 1.5)
    print(
        "| friction of the two | mean | " + " | ".join(WORLDS) + " |\n" + "|---|---|" + "---|" * len(WORLDS)
    )
    for k, a in enumerate(coefficients):
        for b in coefficients[k:]:
            row = [f"{a:g}, {b:g}", f"{np.sqrt(a * b):.4f}"]
            for engine in WORLDS:
                found = sliding_friction("box", engine, Material(friction=a), Material(friction=b), Path())
                row.append(f"{found:.4f}")
            print("| " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
