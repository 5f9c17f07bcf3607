"""The tutorial's experiments: one arm, one motion, every mode of control, on two plants.

A six-axis arm goes along a cycloidal motion of 2 s in PyBullet, in steps of 1 ms, under a gravity of
9.8 m/s^2: by the engine's position and velocity motors, by feed-forward torque, and by computed torque with
the gains 400 and 40. To these come the other controllers for joints that dynx has, and a second plant: dynx's
integrator over Pinocchio. `plot_rows` draws the tracking errors.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.registry import backend_class
from dynx.control.base import Controller
from dynx.control.bullet import BulletMotor
from dynx.errors import (
    ArgumentError,
    BackendError,
    DynxError,
    SimulationError,
    UnsupportedFeatureError,
)
from dynx.files.figures import line_style, new_figure, save_figure
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim.named_controllers import BUILT_IN, ControllerRequest, named_controller
from dynx.sim.record.rollout import Rollout
from dynx.sim.simulation import simulate
from dynx.spatial.scalar import Floats
from dynx.trajectory import Trajectory, check, cycloidal

ROBOT = "ur5"
TO = (-1.5, -1.0, 1.0, -1.57, -1.57, -1.57)
"""Final configuration [rad] of the motion of a six-axis arm, which begins at 0."""
DURATION, DT, GRAVITY = 2.0, 1e-3, (0.0, 0.0, -9.8)
BULLET, PINOCCHIO = PLANTS = ("pybullet", "pinocchio")
"""PyBullet's own stepper, and dynx's semi-implicit Euler over Pinocchio's forward dynamics."""
MODES = tuple(name for name, law in BUILT_IN.items() if law.controls == "joints")
"""All modes of control; those that need least knowledge of the robot come first."""


@dataclass(frozen=True)
class TutorialResult:
    """One mode on one plant: its record, and the error that prevented or ended it."""

    rollout: Rollout | None = None
    """Record, as far as the simulation came; None if it did not begin."""
    problem: str | None = None
    """Message of the error; None if there was none."""

    @property
    def failed(self) -> bool:
        """True if a simulation ended early."""
        return self.rollout is not None and self.problem is not None

    @property
    def max_error(self) -> float | None:
        """The largest error of any joint at any time [rad or m]; None if it did not reach the end."""
        return None if self.rollout is None or self.failed else float(np.max(np.abs(self.rollout.error)))

    @property
    def rms_error(self) -> float | None:
        """The root mean square over all joints and times [rad or m]; None if it did not reach the end."""
        if self.rollout is None or self.failed:
            return None
        return float(np.sqrt(np.mean(self.rollout.error**2)))


@dataclass(frozen=True)
class Row:
    """One mode of control on every plant."""

    mode: str
    """Name of the controller, as in `named_controller`."""
    what: str
    """Description of the controller, in one line."""
    outcomes: Mapping[str, TutorialResult] = field(default_factory=dict)
    """Result on each plant, by its name."""


@dataclass(frozen=True)
class Tutorial:
    """The experiments of one robot and motion; `tutorial` makes them."""

    model: Model
    motion: Trajectory
    """Reference of every controller."""
    dt: float = DT
    """Step of the plants, and the control step [s]."""
    plants: tuple[str, ...] = PLANTS
    """Backends that move the robot."""
    backend: str = PINOCCHIO
    """Backend with which the controllers compute."""

    def rows(self) -> Iterator[Row]:
        """Simulate and yield the rows one by one; the outcome of an unavailable mode has the reason."""
        missing = {plant: _missing(plant) for plant in self.plants}
        for mode in MODES:
            yield Row(
                mode,
                BUILT_IN[mode].what,
                {
                    plant: self._outcome(mode, plant) if problem is None else TutorialResult(problem=problem)
                    for plant, problem in missing.items()
                },
            )

    def _outcome(self, mode: str, plant: str) -> TutorialResult:
        try:
            law = self._law(mode)
            if isinstance(law, BulletMotor) and plant != BULLET:
                return TutorialResult(problem="a motor inside PyBullet")
            return TutorialResult(simulate(self.model, law, self.motion, plant=plant, dt=self.dt))
        except SimulationError as error:
            return TutorialResult(error.rollout, str(error))
        except DynxError as error:
            return TutorialResult(problem=str(error))

    def _law(self, mode: str) -> Controller[object]:
        return named_controller(
            mode, ControllerRequest(self.model, self.motion.start.q, self.dt, backend=self.backend)
        )


def tutorial(
    model: Model | None = None,
    *,
    start: ArrayLike | None = None,
    to: ArrayLike | None = None,
    duration: float = DURATION,
    dt: float = DT,
    plants: tuple[str, ...] = PLANTS,
    backend: str = PINOCCHIO,
) -> Tutorial:
    """Prepare the tutorial's experiments; `model` is by default the UR5 with the tutorial's gravity.

    The cycloidal motion goes from `start` (neutral by default) to `to` (by default `TO`, for an arm of six
    joints) in `duration` [s], in steps of `dt`, on `plants`; the controllers compute with `backend`.

    Raises ArgumentError for an invalid motion, LimitError for one outside the robot's limits of
    position and velocity, UnsupportedFeatureError for a floating base, BackendError for a backend that
    cannot be used.
    """
    robot = load(ROBOT, gravity=GRAVITY) if model is None else model
    if robot.floating:
        raise UnsupportedFeatureError(f"the tutorial needs a fixed base, and {robot.name} has a floating one")
    begin: Floats | ArrayLike = robot.neutral() if start is None else start
    if to is None:
        if robot.nq != len(TO):
            raise ArgumentError(
                f"the tutorial's motion has {len(TO)} coordinates and {robot.name} has {robot.nq}; "
                "give the final configuration as `to`"
            )
        to = TO
    motion = cycloidal(begin, to, duration, model=robot)
    check(robot, motion, effort=False)
    backend_class(backend).require_engine()
    return Tutorial(robot, motion, dt, plants, backend)


def _missing(plant: str) -> str | None:
    """Return the reason why a plant is not available, None if it is."""
    try:
        backend_class(plant).require_engine()
    except BackendError as error:
        return str(error)
    return None


LEAST = 1e-16
"""Smallest error on the logarithmic axis; smaller ones are rounding errors and are drawn there."""


def plot_rows(rows: Sequence[Row], tutorial: Tutorial, path: str | os.PathLike[str] | None = None) -> Any:
    """Plot the errors in a panel for each plant, save the figure at `path` and return it.

    The curves show the largest error of all joints at each time. Raises NotInstalledError without matplotlib
    (extra ``plot``), ArgumentError where the file cannot be written.
    """
    figure = new_figure(7.0, 2.0 + 3.2 * len(tutorial.plants))
    panels = figure.subplots(len(tutorial.plants), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axis, plant in zip(panels, tutorial.plants, strict=True):
        for k, row in enumerate(rows):
            rollout = row.outcomes[plant].rollout
            style = {**line_style(k), "lw": 1.3, "label": row.mode}
            if rollout is None:
                axis.plot([], [], **style)
                continue
            largest = np.max(np.abs(rollout.error), axis=1)
            axis.semilogy(rollout.t, np.maximum(largest, LEAST), **style)
        own = "PyBullet's own stepper" if plant == BULLET else f"dynx's semi-implicit Euler over {plant}"
        axis.set_title(own, fontsize=10)
        axis.set_ylabel("largest error [rad or m]")
        axis.grid(visible=True, color="0.9")
    panels[-1].set_xlabel("time [s]")
    figure.suptitle(f"{tutorial.model.name}: every mode of control on one motion", fontsize=11)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    if path is not None:
        save_figure(figure, path)
    return figure
