"""Loads during the steps of one call: held torques, or loads that are evaluated before every step."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import isfinite

import numpy as np
from numpy.typing import ArrayLike

from dynx.control.engine_motors import MotorCommand
from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model import Model
from dynx.model.numbers import checked_array
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout, RobotLayout
from dynx.steppers.stepper import Stepper, Torque
from dynx.world.loads import RobotLoads, Wrench, checked_torques, found_robot
from dynx.world.motors import Motor
from dynx.world.notes.divergence import LastLoads, RobotLoad
from dynx.world.snapshot import Memory

MotorsOf = Mapping[str, "Motor | MotorCommand | Sequence[Motor]"]

Act = Callable[[Stepper], list[Torque] | None]
"""Apply the wrenches and motors of the next step to the engine, and return the torques that act in it; None
if one of them is not finite."""

_NOTHING: list[Torque] = []


class Commands:
    """Loads on the robots and bodies of one world, and what the engine still holds of earlier ones."""

    def __init__(
        self, layout: Layout, robots: Mapping[str, int], bodies: Mapping[str, int], h: float
    ) -> None:
        self._layout = layout
        self._robots = robots
        self._bodies = bodies
        self._loads = [RobotLoads(robot, h) for robot in layout.robots]
        shapes: list[tuple[int]] = [(robot.model.nv,) for robot in layout.robots]
        self._torques = {name: (k, shapes[k]) for name, k in robots.items()}
        self._floating = [robot.model.floating for robot in layout.robots]
        self._no_wrench = np.zeros((len(layout.bodies), 6))
        self._held: Sequence[Torque] = _NOTHING
        self._wrenches: Floats = self._no_wrench
        self.forget()

    def forget(self) -> None:
        """Forget all earlier steps: the engine is new, or its state was set."""
        # Wrenches are sent once more before the next step.
        self._pushed = self._more_than_torques = True
        self._commanded: set[int] = set()
        self._forget_steps(frozenset())

    def last(self) -> LastLoads:
        """Return the loads of the last step."""
        pushed = np.flatnonzero(self._wrenches.any(axis=1)).tolist()
        held = {k: tau for k, tau, _ in self._held}
        return LastLoads(
            [
                RobotLoad(k, loads.dynamics, held.get(k), *loads.law)
                for k, loads in enumerate(self._loads)
                if loads.has_motors or k in held
            ],
            {k: self._wrenches[k] for k in pushed},
        )

    def memory(self) -> Memory:
        """Return what the motors keep from one step to the next."""
        kept = (loads.memory for loads in self._loads)
        return tuple(None if m is None else (tuple(m[0].tolist()), tuple(m[1].tolist())) for m in kept)

    def remember(self, memory: Memory) -> None:
        """Restore what `memory` returned."""
        for loads, m in zip(self._loads, memory, strict=True):
            loads.memory = None if m is None else (np.array(m[0]), np.array(m[1]))
        self._more_than_torques = True

    def hold(
        self, engine: Stepper, torques: Mapping[str, ArrayLike] | None, count: int
    ) -> Sequence[Torque] | None:
        """Return what the engine applies in the next `count` steps where these torques alone act in them.

        Returns None, and does nothing, where the engine must get them again before each of the steps.
        """
        held = _NOTHING if torques is None else checked_torques(torques, self._torques)
        if count > 1 and any(self._floating[k] and any(entries[:6]) for k, _, entries in held):
            return None
        self._held = held
        if self._more_than_torques:
            self._end_other_loads(engine)
        return held

    def _end_other_loads(self, engine: Stepper) -> None:
        """End the wrenches on bodies and the engine's own motors, and forget what motors keep."""
        self._more_than_torques = False
        if self._pushed:
            self._wrenches = self._no_wrench
            engine.set_wrenches(self._no_wrench)
            self._pushed = False
        if self._commanded:
            self._command(engine, {})
        self._forget_steps(frozenset())

    def plan(
        self,
        torques: Mapping[str, ArrayLike] | None,
        motors: MotorsOf | None,
        wrenches: Sequence[Wrench],
    ) -> Act:
        """Check what acts in the next steps, and return the function that applies it before each of them."""
        self._more_than_torques = True
        self._held = checked_torques({} if torques is None else torques, self._torques)
        held = {torque[0]: torque for torque in self._held}
        commands = self._set_motors(motors or {})
        frames, pushes = self._sort_wrenches(wrenches)
        motored = frozenset(k for k, loads in enumerate(self._loads) if loads.has_motors)
        repeated = motored | frames.keys()
        of_joints = {k for k in motored - frames.keys() if self._loads[k].depends_on_joints}
        constant = [torque for torque in self._held if torque[0] not in repeated]
        self._forget_steps(motored)
        begun = False

        def act(engine: Stepper) -> list[Torque] | None:
            nonlocal begun
            if not begun:
                begun = True
                self._command(engine, commands)
            acting = constant.copy()
            for k in repeated:
                loads, given = self._loads[k], held[k][1] if k in held else None
                if k in of_joints:
                    tau = loads.torque_of_joints(*engine.joint_state(k), given)
                else:
                    tau = loads.torque(*engine.robot_state(k), given, frames.get(k, ()))
                entries = tau.tolist()
                # A finite sum has finite entries; of few numbers, Python's is the fastest.
                if not isfinite(sum(entries)) and not np.isfinite(tau).all():
                    return None
                acting.append((k, tau, entries))
            if pushes or self._pushed:
                self._push(engine, pushes)
            return acting

        return act

    def _set_motors(self, motors: MotorsOf) -> dict[int, MotorCommand]:
        """Give the motors to their robots; return the commands to the engine's own motors."""
        if not isinstance(motors, Mapping):
            raise ArgumentError(f"motors is of type {type(motors).__name__}; wanted a dict by robot")
        commands: dict[int, MotorCommand] = {}
        given: dict[int, list[Motor]] = {}
        for name, listed in motors.items():
            k = found_robot(name, self._robots)
            if isinstance(listed, MotorCommand):
                commands[k] = checked_command(listed, self._layout.robots[k].model)
                continue
            several: Sequence[object] = listed if isinstance(listed, tuple | list) else [listed]
            given[k] = []
            for each in several:
                if not isinstance(each, Motor):
                    raise ArgumentError(f"a motor of {name} is {shown(each)}; wanted a Motor or MotorCommand")
                given[k].append(each)
        for k, loads in enumerate(self._loads):
            loads.set_motors(given.get(k, ()))
        return commands

    def _sort_wrenches(
        self, wrenches: Sequence[Wrench]
    ) -> tuple[dict[int, list[tuple[str, Wrench]]], dict[int, list[Wrench]]]:
        """Return the wrenches on the frames of each robot, and on each body, by number."""
        frames: dict[int, list[tuple[str, Wrench]]] = {}
        pushes: dict[int, list[Wrench]] = {}
        for wrench in wrenches:
            if not isinstance(wrench, Wrench):
                raise ArgumentError(f"a wrench is {shown(wrench)}; wanted a Wrench")
            owner, slash, frame = wrench.on.partition("/")
            if owner in self._robots and slash:
                k = self._robots[owner]
                self._layout.robots[k].model.frame_index(frame)
                frames.setdefault(k, []).append((frame, wrench))
            elif owner in self._bodies and not slash:
                k = self._bodies[owner]
                if self._layout.bodies[k].fixed:
                    raise ArgumentError(f"a wrench acts on {shown(owner)}, which is fixed in the world")
                pushes.setdefault(k, []).append(wrench)
            else:
                known = [*self._bodies, *(f"{name}/{r.model.root}" for name, r in self._named_robots())]
                raise UnknownNameError(
                    f"a wrench acts on {shown(wrench.on)}; wanted a body or robot/link"
                    f"{nearest(wrench.on, known)}"
                )
        return frames, pushes

    def _named_robots(self) -> list[tuple[str, RobotLayout]]:
        return [(name, self._layout.robots[k]) for name, k in self._robots.items()]

    def _push(self, engine: Stepper, pushes: Mapping[int, Sequence[Wrench]]) -> None:
        total = self._no_wrench.copy()
        for k, wrenches in pushes.items():
            T, center = engine.body_state(k).T_world_body, self._layout.bodies[k].center
            total[k] = np.sum([wrench.at(T, center) for wrench in wrenches], axis=0)
        self._wrenches = total
        engine.set_wrenches(total)
        self._pushed = bool(pushes)

    def _command(self, engine: Stepper, commands: Mapping[int, MotorCommand]) -> None:
        for k in self._commanded - commands.keys():
            engine.command_motors(k, None)
        for k, command in commands.items():
            engine.command_motors(k, command)
        self._commanded = set(commands)

    def _forget_steps(self, motored: frozenset[int]) -> None:
        """Forget the step before, of robots without motors in the next one."""
        for k, loads in enumerate(self._loads):
            if k not in motored:
                loads.memory = None


def with_scene_motors(
    scene_motors: Mapping[str, Sequence[Motor]],
    torques: Mapping[str, ArrayLike] | None,
    motors: MotorsOf | None,
) -> MotorsOf:
    """Add the motors of the scene on robots that neither `torques` nor `motors` name."""
    for name, given in (("torques", torques), ("motors", motors)):
        if given is not None and not isinstance(given, Mapping):
            raise ArgumentError(f"{name} is of type {type(given).__name__}; wanted a dict by robot")
    driven = {*(motors or ()), *(torques or ())}
    return {**{name: own for name, own in scene_motors.items() if name not in driven}, **(motors or {})}


def checked_command(command: MotorCommand, model: Model) -> MotorCommand:
    """Return a command with one finite float per joint in each of its lists."""
    n = len(model.joint_names)
    checked = {}
    for name, numbers in command._asdict().items():
        if name != "mode" and numbers is not None:
            numbers = checked_array(f"{name} of a motor command", numbers, n)
            if numbers.ndim != 1:
                raise ShapeError(f"{name} of a motor command has shape {numbers.shape}; wanted ({n},)")
            numbers = numbers.tolist()
        checked[name] = numbers
    return MotorCommand(**checked)
