"""Sentences on a world: what is amiss at its start, and the likely causes where it diverged.

At the start these are overlaps, violated constraints, joints beyond their limits, accelerations without a
bound, parts that are too fast for the step, and coefficients of contact that the engine does not have. Likely
causes of divergence are gains, torques, forces, overlaps and light parts. Names of parts are in quotes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from dynx.backends.singular_direction import main_joints, singular_direction
from dynx.errors import DynxError, shown
from dynx.model.elements import IDENTITY, Joint, Vector
from dynx.model.mechanism import ROOT, Mechanism
from dynx.model.tree import STANDARD_GRAVITY
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation, quat_log
from dynx.steppers.forces import JointLaw
from dynx.steppers.layout import Collider, ConstraintLayout, Layout, Owner
from dynx.steppers.materials import inexact_materials
from dynx.steppers.state import WorldState
from dynx.steppers.stepper import Stepper
from dynx.world.boxes import owner_pose, shape_box
from dynx.world.motors import combine
from dynx.world.scene.scene import Scene

if TYPE_CHECKING:
    from dynx.world.scene.bodies import SceneBody
    from dynx.world.sensors.sensor import Sensor

MIN_DEPTH = 1e-3
"""Depth [m] from which two parts count as overlapping: at rest, parts sink into one another by less."""

MIN_DEPTH_SHARE = 0.05
"""Depth from which two smaller parts do, relative to the shortest edge of the smaller one's box."""


class Overlap(NamedTuple):
    """Two parts that overlap, and by how much at their deepest contact [m]."""

    a: str
    b: str
    depth: float


def overlaps_of(engine: Stepper) -> tuple[Overlap, ...]:
    """Return the parts that may touch and overlap at the present state, the deepest first."""
    deepest: dict[tuple[int, int], float] = {}
    for point in engine.contacts():
        pair = min(point.a, point.b), max(point.a, point.b)
        deepest[pair] = max(deepest.get(pair, 0.0), -point.distance)
    colliders = engine.layout.colliders
    found = [
        Overlap(colliders[a].name, colliders[b].name, depth)
        for (a, b), depth in deepest.items()
        if depth > min(MIN_DEPTH, MIN_DEPTH_SHARE * min(_shortest_edge(colliders[k]) for k in (a, b)))
    ]
    return tuple(sorted(found, key=lambda overlap: -overlap.depth))


def _shortest_edge(collider: Collider) -> float:
    """Return the shortest edge of the boxes around the shapes [m]."""
    boxes = (shape_box(each.shape, each.T) for each in collider.shapes)
    return min(float(np.min(upper - lower)) for lower, upper in boxes)


def unbounded_motions(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield, for each robot, why its acceleration has no bound at a state or where two of its axes align."""
    for robot in layout.robots:
        model = robot.model
        if not model.mechanism.bodies:
            continue
        found = singular_direction(model, state.robots[robot.name].q, robot.armature)
        if found is not None:
            joints = [shown(f"{robot.name}/{name}") for name in main_joints(model, found.direction)]
            yield (
                f"the mass matrix of {shown(robot.name)} is singular to rounding, because its links have "
                f"almost no inertia about {' and '.join(joints) or 'its base'}"
            )
        elif (axes := _massless_gimbal(model.mechanism)) is not None:
            first, last = (shown(f"{robot.name}/{model.mechanism.bodies[k].joint}") for k in axes)
            yield (
                f"the links between {first} and {last} have no mass, so that the motion has no bound where "
                "the axes of these two joints align"
            )


def _massless_gimbal(mechanism: Mechanism) -> tuple[int, int] | None:
    """Return the first and the last of three revolute joints in series without mass between them; the axes of
    a ball joint never align."""
    children = Counter(body.parent for body in mechanism.bodies)
    for last in range(len(mechanism.bodies)):
        chain = [last]
        while len(chain) < 3 and (parent := mechanism.bodies[chain[-1]].parent) != ROOT:
            inertia = mechanism.bodies[parent].inertia
            if float(inertia.mass) != 0.0 or np.any(inertia.rotational_inertia != 0.0):
                break
            if children[parent] > 1:
                break
            chain.append(parent)
        bodies = [mechanism.bodies[k] for k in chain]
        if len(chain) == 3 and all(each.revolute and each.ball is None for each in bodies):
            return chain[-1], last
    return None


MAX_NOTED = 5
"""Largest number of overlaps, and of joints beyond their limits, that are noted one by one."""

LIMIT_EXCESS = 1e-3
"""Distance [rad or m] beyond a limit from which a joint is noted."""

CONSTRAINT_GAP, CONSTRAINT_ANGLE = 1e-4, 1e-3
"""Distance [m] and angle [rad] between the ends of a constraint from which it counts as violated."""

LONG_STEP = 0.1
"""Step of an engine [s] above which contacts are hardly noticed."""


def notes_on_start(engine: Stepper, state: WorldState) -> tuple[str, ...]:
    """Return one sentence for each overlap, violated constraint and joint beyond its limits of an engine at a
    state, for each robot whose accelerations have no bound, and for each part that is too fast."""
    drawn = "so that they are pulled together in the first steps"
    return (
        *_overlaps_at_start(engine),
        *(f"{each} at the start, {drawn}" for each in violations(engine.layout, state)),
        *notes_on_limits(joints_beyond_limits(engine.layout, state), engine.beyond_limits),
        *notes_on_held_joints(_held_joints(engine.layout)),
        *unbounded_motions(engine.layout, state),
        *_fast_parts(engine, state),
    )


def _fast_parts(engine: Stepper, state: WorldState) -> Iterator[str]:
    """Yield each part that is too fast for the step; most scenes begin at rest."""
    of_robots = [robot.v for robot in state.robots.values()]
    if any(velocity.any() for velocity in (*of_robots, *(body.twist for body in state.bodies.values()))):
        from dynx.world.fast_parts import fast_parts

        yield from fast_parts(engine, state)


def notes_on_gravity(scene: Scene) -> Iterator[str]:
    """Yield one sentence for each robot that was given another gravity than its scene, whose gravity acts."""
    for robot in scene.robots:
        own = robot.model.gravity
        if own not in (scene.gravity, STANDARD_GRAVITY):
            yield (
                f"gravity is {_vector(scene.gravity)} m/s^2, that of the scene, and not the {_vector(own)} "
                f"of the model of {shown(robot.name)}"
            )


def _vector(values: Vector) -> str:
    return f"({', '.join(f'{each:g}' for each in values)})"


def notes_on_engine(engine: Stepper) -> Iterator[str]:
    """Yield one sentence for each coefficient of contact and shape that the engine does not have, for a long
    step, and for each robot without collision shapes: they hold at every state."""
    yield from map(str, inexact_materials(engine))
    yield from _replaced_shapes(engine)
    if engine.dt > LONG_STEP:
        yield f"a step of {engine.dt:g} s is longer than {LONG_STEP:g} s: bodies may pass through one another"
    yield from _robots_without_shapes(engine.layout)


def _replaced_shapes(engine: Stepper) -> Iterator[str]:
    """Yield each kind of shape that the engine collides as another, and the parts that have it."""
    for kind, other in engine.replaced_shapes.items():
        parts = [
            shown(collider.name)
            for collider in engine.layout.colliders
            if any(isinstance(each.shape, kind) for each in collider.shapes)
        ]
        if parts:
            more = f" and {len(parts) - 3} more parts" if len(parts) > 3 else ""
            first = f"{', '.join(parts[:3])}{more}"
            yield f"{shown(engine.name)} has no {kind.__name__}: it collides {first} as {other}"


def _robots_without_shapes(layout: Layout) -> Iterator[str]:
    """Yield each robot that passes through what others have in its way, because it has no collision shape."""
    shaped = {collider.owner.robot for collider in layout.colliders}
    for k, robot in enumerate(layout.robots):
        if shaped and k not in shaped:
            yield f"no link of {shown(robot.name)} has a collision shape: it passes through everything"


def _overlaps_at_start(engine: Stepper) -> Iterator[str]:
    found = overlaps_of(engine)
    for each in found[:MAX_NOTED]:
        yield (
            f"{shown(each.a)} and {shown(each.b)} overlap by {1e3 * each.depth:.3g} mm at the start, so that "
            "they are pushed apart in the first steps"
        )
    if len(found) > MAX_NOTED:
        yield f"{len(found) - MAX_NOTED} more pairs of parts overlap at the start"


def violations(layout: Layout, state: WorldState) -> Iterator[str]:
    """Yield each constraint whose ends are apart, and by how much."""
    for constraint in layout.constraints:
        gap, angle = _deviation(layout, constraint, state)
        turned = constraint.kind == "weld" and angle > CONSTRAINT_ANGLE
        if gap > CONSTRAINT_GAP or turned:
            kind = "weld" if constraint.kind == "weld" else "point-to-point constraint"
            ends = " and ".join(map(shown, constraint.names))
            more = f" and turned by {angle:.3g} rad" if turned else ""
            yield f"the ends of the {kind} of {ends} are {1e3 * gap:.3g} mm apart{more}"


def notes_on_limits(beyond: Sequence[str], effect: str) -> Iterator[str]:
    """Yield a sentence for each of the first joints that begin beyond a limit (`beyond_limits`), with the
    effect on them, and the number of the others."""
    yield from (f"{each}, {effect}" for each in beyond[:MAX_NOTED])
    if len(beyond) > MAX_NOTED:
        yield f"{len(beyond) - MAX_NOTED} more joints are beyond their limits at the start"


def notes_on_held_joints(joints: Sequence[str]) -> Iterator[str]:
    """Yield a sentence on the joints whose limits leave no range, if there is one."""
    if joints:
        more = f" and {len(joints) - MAX_NOTED} more" if len(joints) > MAX_NOTED else ""
        listed = ", ".join(map(shown, joints[:MAX_NOTED]))
        yield f"limits without a range hold {listed}{more}; joint_limits=False switches them off"


def joints_without_range(joints: Iterable[Joint], lower: Floats, upper: Floats) -> list[str]:
    """Return the names of the joints that their limits (n,) hold in one place; of a ball joint only `upper`
    counts, the largest angle."""
    return [
        joint.name
        for joint, low, high in zip(joints, lower, upper, strict=True)
        if (0.0 if joint.type == "ball" else low) == high
    ]


def _held_joints(layout: Layout) -> list[str]:
    """Return the joints of all robots that their limits hold."""
    return [
        f"{robot.name}/{name}"
        for robot in layout.robots
        for name in joints_without_range(
            (each for each in robot.model.joints if each.moves), *robot.joint_positions(robot.q)[1:]
        )
    ]


def beyond_limits(names: Sequence[str], q: Floats, lower: Floats, upper: Floats) -> list[str]:
    """Return the beginning of a sentence for each joint, at q (n,), that is beyond a limit."""
    return [
        f"{shown(name)} is at {x:.4g}, beyond its limits "  # a ball joint has only an upper one
        f"{'up' if low == -np.inf else f'{low:.4g}'} to {high:.4g}, at the start"
        for name, x, low, high in zip(names, q, lower, upper, strict=True)
        if not low - LIMIT_EXCESS <= x <= high + LIMIT_EXCESS
    ]


def joints_beyond_limits(layout: Layout, state: WorldState) -> list[str]:
    """Return the beginning of a sentence for each joint that is beyond a limit."""
    found = []
    for robot in layout.robots:
        names = [f"{robot.name}/{joint.name}" for joint in robot.model.joints if joint.moves]
        found += beyond_limits(names, *robot.joint_positions(state.robots[robot.name].q))
    return found


def _deviation(layout: Layout, constraint: ConstraintLayout, state: WorldState) -> tuple[float, float]:
    """Return the distance [m] and the angle [rad] between the frames of the two ends."""
    a, b = (owner_pose(layout, end.owner, state) @ end.T for end in (constraint.a, constraint.b))
    rotation = quat_log(quat_from_rotation(a[:3, :3].T @ b[:3, :3]))
    return float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.linalg.norm(rotation))


MIN_SPEED_CHANGE = 100.0
"""Change of a velocity [rad/s or m/s] in one step from which a torque or force is a likely cause."""

MIN_MASS_RATIO = 1e4
"""Ratio of the masses of two bodies that touch from which it is a likely cause."""

MIN_IMPLICIT_RATIO = 2.0
"""Ratio of kd dt + kp dt^2 to the inertia from which a motor at the end of a step is named."""

MAX_CAUSES = 3
"""Largest number of causes in a message."""


class RobotLoad(NamedTuple):
    """Loads on a robot in the last step: the caller's torque, and the law of its motors."""

    robot: int
    mass_matrix: Callable[[Floats], Floats]
    """From q (nq,) to M (nv, nv), with armature."""
    torque: Floats | None
    law: JointLaw | None
    implicit: Floats | None
    """1 for joints whose law holds at the end of the step, 0 for the others (n,)."""


def notes_on_angles(scene: Scene) -> Iterator[str]:
    """Yield a sentence for each rotation of the scene and each target of its motors that is far beyond a full
    turn or the limits of the joint, as angles in degrees are."""
    placed: list[SceneBody | Sensor] = [*scene.bodies, *scene.sensors]
    # Some sensors have no pose of their own.
    poses = [(f"the pose of {shown(each.name)}", getattr(each, "pose", IDENTITY)) for each in placed]
    targets = []
    for robot in scene.robots:
        law, _ = combine(robot.model, robot.motors)
        if law.kp.any():
            targets.append((robot, law))
    turned = [(name, pose) for name, pose in poses if max(map(abs, pose.rpy)) > 2.0 * np.pi]
    if not turned and not targets:
        return
    # Imported here, because angles hardly ever are in degrees.
    from dynx.model.unlikely_inputs import rotation_notes, target_notes

    for name, pose in turned:
        yield from rotation_notes(pose.rpy, name)
    for robot, law in targets:
        yield from target_notes(robot.model, robot.name, law.kp, law.target)


class LastLoads(NamedTuple):
    """Loads of the last step: on robots, and force and moment (6,) on bodies by number."""

    robots: Sequence[RobotLoad]
    wrenches: Mapping[int, Floats]


def likely_causes(
    begun: Stepper, start: WorldState, engine: Stepper, loads: LastLoads, h: float
) -> list[str]:
    """Return what probably made a world diverge in steps of `h` [s], the most likely first.

    `begun` is at the state `start` in which the motion began, `engine` at the state kept last, in which
    overlaps and positions beyond limits may be consequences. Where nothing is conspicuous, a shorter step is
    recommended.
    """
    layout = begun.layout
    try:
        causes = [
            *_gravity(layout, h),
            *_gains_and_torques(layout, start, loads, h),
            *_wrenches(layout, loads, h),
            *_overlaps_as_cause(begun),
            *(f"{each} at the start" for each in islice(violations(layout, start), 1)),
            *joints_beyond_limits(layout, start)[:1],
            *_light_parts(engine),
            *unbounded_motions(layout, start),
        ]
        predicted = not causes and not engine.solves_motors
        gains = "".join(islice(_implicit_gains(layout, start, loads, h), 1)) if predicted else ""
    except DynxError:
        # The message of the failure itself matters more than its explanation.
        causes, gains = [], ""
    shorter = f"the step is too long for the motion{gains}; try a smaller dt or more substeps"
    return causes[:MAX_CAUSES] or [shorter]


def _gravity(layout: Layout, h: float) -> Iterator[str]:
    change = h * float(np.linalg.norm(layout.gravity))
    if change > MIN_SPEED_CHANGE:
        yield f"gravity changes velocities by {change:.3g} m/s in one step of {h:.3g} s"


def _gains_and_torques(layout: Layout, state: WorldState, loads: LastLoads, h: float) -> Iterator[str]:
    from dynx.steppers.stability import mobility_of, notes_on_gains

    for load in loads.robots:
        robot = layout.robots[load.robot]
        mobility = mobility_of(load.mass_matrix(state.robots[robot.name].q))
        names = robot.model.coordinate_names
        base = len(mobility) - len(names)
        if load.law is not None and load.implicit is not None and len(names):
            yield from notes_on_gains(robot.name, names, load.law, load.implicit, mobility[base:], h)
        if load.torque is not None and len(mobility):
            change = h * np.abs(load.torque) * mobility
            k = int(np.argmax(change))
            if change[k] > MIN_SPEED_CHANGE:
                where = shown(f"{robot.name}/{names[k - base]}") if k >= base else f"the base of {robot.name}"
                yield (
                    f"the torque of {load.torque[k]:.3g} on {where} changes its velocity by "
                    f"{change[k]:.3g} in one step of {h:.3g} s"
                )


def _implicit_gains(layout: Layout, state: WorldState, loads: LastLoads, h: float) -> Iterator[str]:
    """Yield, for each robot, the motor at the end of a step whose gains are the largest for the inertia.

    It computes the velocity at the end of the step with the other forces of the step before. What these
    change by in a step acts as if there were no motor; the stiffer the gains, the harder the correction.
    """
    from dynx.steppers.stability import mobility_of

    for load in loads.robots:
        robot = layout.robots[load.robot]
        names = robot.model.coordinate_names
        if load.law is None or load.implicit is None or not len(names):
            continue
        mobility = mobility_of(load.mass_matrix(state.robots[robot.name].q))[-len(names) :]
        ratio = load.implicit * h * (load.law.kd + h * load.law.kp) * mobility
        k = int(np.argmax(ratio))
        if ratio[k] > MIN_IMPLICIT_RATIO:
            yield (
                f" and the gains of {shown(f'{robot.name}/{names[k]}')} (kd dt + kp dt^2 is {ratio[k]:.3g} "
                "times the inertia)"
            )


def _wrenches(layout: Layout, loads: LastLoads, h: float) -> Iterator[str]:
    for k, wrench in loads.wrenches.items():
        body = layout.bodies[k]
        change = h * float(np.linalg.norm(wrench[:3])) / body.mass
        if change > MIN_SPEED_CHANGE:
            yield f"a force changes the velocity of {shown(body.name)} by {change:.3g} m/s in one step"


def _overlaps_as_cause(engine: Stepper) -> Iterator[str]:
    for overlap in islice(overlaps_of(engine), 1):
        names = f"{shown(overlap.a)} and {shown(overlap.b)}"
        pair = f"({shown(overlap.a)}, {shown(overlap.b)})"
        yield (
            f"{names} overlap by {1e3 * overlap.depth:.3g} mm at the start: "
            f"move one of them, or let them pass through each other by ignored=[{pair}] of the Scene"
        )


def _light_parts(engine: Stepper) -> Iterator[str]:
    """Yield the pair of bodies in contact whose masses differ the most."""
    layout = engine.layout
    worst = (MIN_MASS_RATIO, "", "")
    for point in engine.contacts():
        pair = [
            (mass, layout.colliders[k].name)
            for k in (point.a, point.b)
            if (mass := _mass(layout, layout.colliders[k].owner)) is not None
        ]
        if len(pair) == 2 and min(pair)[0] > 0.0:
            worst = max(worst, (max(pair)[0] / min(pair)[0], min(pair)[1], max(pair)[1]))
    ratio, light, heavy = worst
    if light:
        yield f"{shown(light)} touches {shown(heavy)}, which is {ratio:.2g} times as heavy"


def _mass(layout: Layout, owner: Owner) -> float | None:
    """Return the mass of a body [kg], of a robot that of all its links; None for what is fixed."""
    if layout.is_fixed(owner):
        return None
    if owner.robot is None:
        return layout.bodies[owner.body].mass
    return layout.robots[owner.robot].model.total_mass
