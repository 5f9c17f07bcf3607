"""The lander, its legs and the ground of Gymnasium's LunarLander-v3, as a scene of dynx.

Lengths are those of its physics in Box2D (pixels / `SCALE`), taken as metres. The motion is in the plane x-z,
with the origin at the centre of the landing pad, at the height from which Gymnasium measures. The lander is a
robot whose first three joints (x, z and the angle, counterclockwise) hold it to the plane; its coordinates
are those and the angles of its two hips. Gymnasium's source: gymnasium/envs/box2d/lunar_lander.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from functools import cache, lru_cache
from itertools import pairwise

import numpy as np

from dynx.backends import backend
from dynx.control.bullet import BulletMotorCommand
from dynx.envs.task import PAINTS, painted
from dynx.model import Model, Pose
from dynx.model.geometry import Appearance, Box, Collision, Visual
from dynx.model.loading import load
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, SceneRobot, VelocityMotor

SCALE = 30.0
"""Pixels of Gymnasium's picture to a metre."""
WIDTH, HEIGHT = 600.0 / SCALE, 400.0 / SCALE
"""Size of the picture [m]."""
HULL = tuple(
    (x / SCALE, z / SCALE) for x, z in ((-14, 17), (-17, 0), (-17, -10), (17, -10), (17, 0), (14, 17))
)
"""Corners of the lander's body [m], counterclockwise."""
HULL_DENSITY, LEG_DENSITY = 5.0, 1.0
"""Mass of the body and of a leg to an area [kg/m^2]."""
LEG_AWAY, LEG_DOWN = 20.0 / SCALE, 18.0 / SCALE
"""Centre of a leg from the hip [m], outward and downward."""
LEG_SIZE = (4.0 / SCALE, 16.0 / SCALE)
"""Width and height of a leg [m]."""
LEG_LIMITS = (0.35, 0.85)
"""Angles of a leg [rad]: spread, where its motor holds it, and folded."""
LEG_START = 0.49
"""Angle of a leg [rad] at the start."""
LEG_AT_PUSH = -0.05
"""Angle of a leg [rad] while Gymnasium pushes the lander at the start: its legs are beyond their limits then,
and Box2D moves them to `LEG_START` in the same step."""
LEG_TORQUE, LEG_SPEED = 40.0, 0.3
"""Largest torque [N m] of the motor of a leg, and the speed [rad/s] at which it spreads it."""
HOLD_TORQUE = 5.0
"""Torque [N m] that holds a spread leg at its limit in flight."""
LEG_DAMPING = 1000.0
"""Torque of a leg's motor to the error of its speed [N m s/rad], so high that the speed is exact below
`LEG_TORQUE`."""
HULL_FRICTION = GROUND_FRICTION = 0.1
LEG_FRICTION = 0.2
DEPTH = 0.4
"""Extent of the lander's shapes along y [m], normal to the plane of the motion."""
EDGES = 10
"""Number of straight edges of the ground."""
GROUND_DEPTH = 0.5
"""Thickness of the ground below an edge [m]."""
GROUND_WIDTH = 2.0
"""Extent of the ground along y [m]."""
GROUND_BOTTOM = -HEIGHT / 2
"""Height [m] down to which the ground is drawn, below the picture."""
STONE = Appearance("stone", (*PAINTS["stone"], 1.0))
FLAG_HEIGHT = 50.0 / SCALE
FLAG = (25.0 / SCALE, 15.0 / SCALE)
"""Height of a flag's pole, and width and height of its cloth [m]."""
START_HEIGHT = HEIGHT - HEIGHT / 4
"""Height of the lander at the start [m]."""
REACH = math.hypot(LEG_AWAY, LEG_DOWN) + 0.5 * math.hypot(*LEG_SIZE)
"""Largest distance [m] of a point of the lander from its origin."""

LEGS = ("right", "left")
"""The legs in Gymnasium's order: its first is at the larger x."""
LANDER, MOON, BODY = "lander", "moon", "body"


def area_properties(corners: Sequence[tuple[float, float]]) -> tuple[float, float, float, float]:
    """Return area, height of the centroid, and second moments of x and of z about it, of a polygon that is
    symmetric about the z axis, with corners in counterclockwise order (Green's theorem)."""
    area = first = xx = zz = 0.0
    for (x0, z0), (x1, z1) in zip(corners, (*corners[1:], corners[0]), strict=True):
        cross = x0 * z1 - x1 * z0
        area += cross / 2
        first += (z0 + z1) * cross / 6
        xx += (x0 * x0 + x0 * x1 + x1 * x1) * cross / 12
        zz += (z0 * z0 + z0 * z1 + z1 * z1) * cross / 12
    center = first / area
    return area, center, xx, zz - area * center * center


_AREA, CENTER, _XX, _ZZ = area_properties(HULL)
HULL_MASS = HULL_DENSITY * _AREA
LEG_MASS = LEG_DENSITY * LEG_SIZE[0] * LEG_SIZE[1]
"""`CENTER` is the height of the body's centre of mass above its origin [m]."""


def _inertial(mass: float, x: float, z: float, xx: float, zz: float) -> str:
    """Return the element of a plate in the plane x-z, `DEPTH` thick, with mean squares xx, zz [m^2]."""
    yy = DEPTH**2 / 12
    moments = f'ixx="{mass * (yy + zz)}" iyy="{mass * (xx + zz)}" izz="{mass * (xx + yy)}"'
    return (
        f'<inertial><origin xyz="{x} 0 {z}"/><mass value="{mass}"/>'
        f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'
    )


def _box(x: float, z: float, width: float, height: float, paint: str) -> str:
    placed = f'<origin xyz="{x} 0 {z}"/><geometry><box size="{width} {DEPTH} {height}"/></geometry>'
    return f"<collision>{placed}</collision><visual>{placed}{painted(paint)}</visual>"


def _joint(name: str, kind: str, parent: str, child: str, axis: str, lower: float, upper: float) -> str:
    limit = f'<limit lower="{lower}" upper="{upper}" effort="1e6" velocity="1e6"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<axis xyz="{axis}"/>{limit}</joint>'
    )


def _leg(name: str, side: float) -> str:
    """Return a leg at positive (1) or negative (-1) x, and its hip at the origin of the body."""
    x, (width, height) = side * LEG_AWAY, LEG_SIZE
    lower, upper = sorted(side * angle for angle in LEG_LIMITS)
    inertial = _inertial(LEG_MASS, x, -LEG_DOWN, width**2 / 12, height**2 / 12)
    link = f'<link name="{name}_leg">{inertial}{_box(x, -LEG_DOWN, width, height, "dark")}</link>'
    return link + _joint(f"{name}_hip", "revolute", BODY, f"{name}_leg", "0 -1 0", lower, upper)


@lru_cache(maxsize=8)
def lander_model(gravity: float = -10.0) -> Model:
    """Return the lander: joints x, z, angle, right_hip, left_hip; always the same object for one gravity
    [m/s^2], so that what a world computes of it is computed once."""
    (top, top_z), (side, side_z), (_, bottom_z) = HULL[5], HULL[4], HULL[3]
    # Two boxes with the corners of the body's six-cornered outline.
    boxes = _box(0.0, bottom_z / 2, 2 * side, side_z - bottom_z, "orange")
    boxes += _box(0.0, top_z / 2, 2 * top, top_z, "white")
    body = _inertial(HULL_MASS, 0.0, CENTER, _XX / _AREA, _ZZ / _AREA)
    far = 1e3
    return load(
        '<robot name="lander"><link name="sky"/><link name="x_slide"/><link name="z_slide"/>'
        + _joint("x", "prismatic", "sky", "x_slide", "1 0 0", -far, far)
        + _joint("z", "prismatic", "x_slide", "z_slide", "0 0 1", -far, far)
        + _joint("angle", "continuous", "z_slide", BODY, "0 -1 0", -far, far)
        + f'<link name="{BODY}">{body}{boxes}</link>'
        + "".join(_leg(name, side) for name, side in zip(LEGS, (1.0, -1.0), strict=True))
        + "</robot>",
        gravity=(0.0, 0.0, gravity),
    )


LEG_MOTOR = VelocityMotor(
    (-LEG_SPEED, LEG_SPEED), kd=LEG_DAMPING, max_force=LEG_TORQUE, joints=tuple(f"{leg}_hip" for leg in LEGS)
)
"""Motor that spreads the legs slowly, and that a landing overcomes."""

LEG_MOTORS = {
    "pybullet": BulletMotorCommand(
        "VELOCITY_CONTROL",
        velocities=[0.0, 0.0, 0.0, -LEG_SPEED, LEG_SPEED],
        forces=[0.0, 0.0, 0.0, LEG_TORQUE, LEG_TORQUE],
        velocity_gains=[1.0] * 5,
    )
}
"""The engine's own motors of the same law, where `LEG_MOTOR` does not come to rest: it has the contact forces
of the step before, which change in Bullet from step to step by the error of its solver."""


def ground_heights(random: Floats) -> list[float]:
    """Return the heights [m] of the ends of the edges, at x from -`WIDTH` / 2 in steps of `WIDTH` / `EDGES`,
    from `EDGES` + 2 random heights between 0 and `HEIGHT` / 2, as Gymnasium smooths them."""
    heights = random.tolist()
    middle, pad = (EDGES + 1) // 2, HEIGHT / 4
    heights[middle - 2 : middle + 3] = [pad] * 5
    # Gymnasium's mean of three has the factor 0.33, so that the pad is at -0.01 times its height.
    return [0.33 * (heights[i - 1] + heights[i] + heights[i + 1]) - pad for i in range(EDGES + 1)]


def ground_body(heights: Sequence[float]) -> SceneBody:
    """Return the ground: a box below each edge."""
    step = WIDTH / EDGES
    shapes = []
    for number, (left, right) in enumerate(pairwise(heights)):
        slope = math.atan2(right - left, step)
        x = (number + 0.5) * step - WIDTH / 2 + 0.5 * GROUND_DEPTH * math.sin(slope)
        z = 0.5 * (left + right) - 0.5 * GROUND_DEPTH * math.cos(slope)
        size = (math.hypot(step, right - left), GROUND_WIDTH, GROUND_DEPTH)
        shapes.append(Collision(Box(size), origin=Pose((x, 0.0, z), (0.0, -slope, 0.0))))
    seen = [Visual(each.shape, each.origin, STONE) for each in shapes]
    seen += [*_columns(heights), *_flags()]
    return SceneBody(MOON, shapes, material=Material(friction=GROUND_FRICTION), visuals=seen)


def _columns(heights: Sequence[float]) -> Iterator[Visual]:
    """Yield what is seen below the edges down to the end of the picture: columns whose tops are within the
    boxes of their edges, which leave gaps below the corners of the ground."""
    step = WIDTH / EDGES
    for number, (left, right) in enumerate(pairwise(heights)):
        count = 1 + math.floor(abs(right - left) / (0.8 * GROUND_DEPTH))
        width = step / count
        for k in range(count):
            top = min(left + (right - left) * share / count for share in (k, k + 1))
            x = number * step - WIDTH / 2 + (k + 0.5) * width
            column = Box((width, GROUND_WIDTH, top - GROUND_BOTTOM))
            yield Visual(column, Pose((x, 0.0, 0.5 * (top + GROUND_BOTTOM))), STONE)


@cache
def _flags() -> tuple[Visual, ...]:
    """Return the flags at both ends of the landing pad, behind the lander."""
    (width, height), y = FLAG, 0.5 * GROUND_WIDTH
    pole, cloth = Box((0.08, 0.08, FLAG_HEIGHT)), Box((width, 0.04, height))
    white, yellow = (Appearance(paint, (*PAINTS[paint], 1.0)) for paint in ("white", "yellow"))
    foot = 0.33 * 3.0 * HEIGHT / 4 - HEIGHT / 4
    found = []
    for x in (-WIDTH / EDGES, WIDTH / EDGES):
        found.append(Visual(pole, Pose((x, y, foot + 0.5 * FLAG_HEIGHT)), white))
        middle = (x + 0.5 * width, y, foot + FLAG_HEIGHT - 0.5 * height)
        found.append(Visual(cloth, Pose(middle), yellow))
    return tuple(found)


def lander_scene(
    heights: Sequence[float], gravity: float, velocity: Sequence[float] = (0.0, 0.0, 0.0)
) -> Scene:
    """Return the lander at the start, above a ground of these heights [m].

    `gravity` is along z [m/s^2]; `velocity` (3,) is that of x, z and the angle.
    """
    robot = SceneRobot(
        LANDER,
        lander_model(gravity),
        q=(0.0, START_HEIGHT, 0.0, LEG_START, -LEG_START),
        v=(*velocity, 0.0, 0.0),
        material=Material(friction=HULL_FRICTION),
        materials={f"{leg}_leg": Material(friction=LEG_FRICTION) for leg in LEGS},
    )
    return Scene("lunar lander", (robot,), (ground_body(heights),), gravity=(0.0, 0.0, gravity))


def velocity_after_push(fx: float, fz: float, dt: float) -> list[float]:
    """Return the velocity (3,) of x, z and the angle after a force [N] on the centre of mass of the body
    during `dt` [s], with the legs locked where Gymnasium has them."""
    force = np.array([fx, fz, -CENTER * fx])
    velocity: list[float] = (dt * (_mobility_at_push() @ force)).tolist()
    return velocity


@cache
def _mobility_at_push() -> Floats:
    """Return the inverse (3, 3) of the mass matrix of x, z and the angle."""
    q = np.array([0.0, 0.0, 0.0, LEG_AT_PUSH, -LEG_AT_PUSH])
    M = backend(DEFAULT_ENGINE, lander_model(), validate=False).mass_matrix(q)
    return np.asarray(np.linalg.inv(M[:3, :3]))


def clearance(heights: Sequence[float], q: Sequence[float], enough: float) -> float:
    """Return a lower bound of the distance [m] of the lander from the ground along z.

    It is that of the lander's lowest point from the highest end of an edge within `REACH`, or a smaller one
    that is more than `enough`.
    """
    x, z, angle = q[:3]
    step = WIDTH / EDGES
    first, last = math.floor((x - REACH + WIDTH / 2) / step), math.ceil((x + REACH + WIDTH / 2) / step)
    top = max(heights[max(first, 0) : max(last, 0) + 1], default=-math.inf)
    if z - REACH - top > enough:
        return z - REACH - top
    sine, cosine = math.sin(angle), math.cos(angle)
    lowest = min([sine * corner_x + cosine * corner_z for corner_x, corner_z in HULL])
    for side, hip in zip((1.0, -1.0), q[3:], strict=True):
        sine, cosine = math.sin(angle + hip), math.cos(angle + hip)
        half = 0.5 * (abs(sine) * LEG_SIZE[0] + abs(cosine) * LEG_SIZE[1])
        lowest = min(lowest, side * LEG_AWAY * sine - LEG_DOWN * cosine - half)
    return z + lowest - top


MAIN_POWER, SIDE_POWER = 13.0, 0.6
"""Impulse [N s] of an engine for each metre from the centre to the nozzle."""
MAIN_NOZZLE = 4.0 / SCALE
"""Distance of the main engine's nozzle below the origin [m]."""
SIDE_AWAY, SIDE_HEIGHT, SIDE_SHIFT = 12.0 / SCALE, 14.0 / SCALE, 17.0 / SCALE
"""Place of the nozzles of the side engines [m]. Gymnasium has both 14 and 17, so that the place in the body
depends on the angle."""

Planar = tuple[float, float, float]
"""Force along x and z [N], moment about the origin of the lander [N m]."""


NO_FORCE: Planar = (0.0, 0.0, 0.0)


def added(*forces: Planar) -> Planar:
    """Return the sum of forces and moments."""
    fx, fz, moment = map(sum, zip(*forces, strict=True))
    return fx, fz, moment


def main_thrust(angle: float, power: float, dispersion: Sequence[float], dt: float) -> Planar:
    """Return the force of the main engine with a power from 0.5 to 1; `dispersion` (2,) moves its nozzle
    [m]."""
    sine, cosine = math.sin(angle), math.cos(angle)
    down, aside = MAIN_NOZZLE + 2.0 * dispersion[0], dispersion[1]
    scale = MAIN_POWER * power / dt
    # The force points from the nozzle to the origin, so that it has no moment about it.
    return -scale * (sine * down - cosine * aside), scale * (cosine * down + sine * aside), 0.0


def side_thrust(angle: float, power: float, dispersion: Sequence[float], dt: float) -> Planar:
    """Return the force of a side engine: of the left one (power from -1 to -0.5), or the right one."""
    sine, cosine = math.sin(angle), math.cos(angle)
    aside = 3.0 * dispersion[1] + math.copysign(SIDE_AWAY, power)
    ox, oz = sine * dispersion[0] - cosine * aside, -cosine * dispersion[0] - sine * aside
    x, z = ox - sine * SIDE_SHIFT, oz + cosine * SIDE_HEIGHT
    scale = SIDE_POWER * abs(power) / dt
    fx, fz = -scale * ox, -scale * oz
    return fx, fz, x * fz - z * fx


def force_at_center(angle: float, fx: float, fz: float) -> Planar:
    """Return a force on the centre of mass of the body."""
    return fx, fz, -CENTER * (math.sin(angle) * fz + math.cos(angle) * fx)


def gust(index: int, power: float) -> float:
    """Return the wind [N] or its moment [N m] in a step: tanh of two sines that never repeat together."""
    return math.tanh(math.sin(0.02 * index) + math.sin(math.pi * 0.01 * index)) * power
