"""The record of one simulation, and what can be said of it in a few numbers."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from dynx.backends import backend
from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint


class Summary(NamedTuple):
    """What a rollout comes to; errors (nv,) are NaN where there was no reference."""

    rms_error: Floats
    max_error: Floats
    max_speed: Floats
    max_torque: Floats
    energy_drift: float
    """The largest change of the energy since the start, over the largest kinetic energy."""
    saturated: float
    """Share of the steps in which some motor was at its limit."""

    def __str__(self) -> str:
        lost = bool(np.isnan(self.max_error).any())
        worst = "no reference" if lost else f"{self.max_error.max(initial=0.0):.3g}"
        return (
            f"largest error {worst}, largest torque {self.max_torque.max(initial=0.0):.3g}, "
            f"energy drift {self.energy_drift:.2g}, saturated in {100 * self.saturated:.3g} % of the steps"
        )


@dataclass(frozen=True, eq=False)
class Rollout:
    """n steps of a robot in motion: states at n + 1 times, and what acted between them.

    Row k of `a`, `tau` and `saturated` belongs to the step from ``t[k]`` to ``t[k + 1]``: the torque that
    acted on the plant, the acceleration as the step began, and where a motor was at its limit.
    """

    model: Model
    """The robot that moved: that of the plant, with its payload and its masses."""
    t: Floats
    """Times (n + 1,) [s]."""
    q: Floats
    """Configurations (n + 1, nq)."""
    v: Floats
    """Velocities (n + 1, nv)."""
    a: Floats
    """Accelerations (n, nv)."""
    tau: Floats
    """Torques of the motors (n, nv) [N m or N]."""
    saturated: np.ndarray[Any, np.dtype[np.bool_]]
    """Where a motor was at its limit (n, nv)."""
    reference: Setpoint | None
    """What was wanted at each time: (n + 1, nq), (n + 1, nv), (n + 1, nv)."""
    rotors: Floats
    """Inertia of the rotors (nv, nv), zero unless armature was asked for."""
    settings: dict[str, Any] = field(default_factory=dict)
    """What `dynx.simulate` was asked, as numbers and text."""

    def __len__(self) -> int:
        """The number of steps."""
        return len(self.tau)

    @cached_property
    def error(self) -> Floats:
        """What was missing to the reference, `model.difference(q, q*)` (n + 1, nv); NaN without one."""
        if self.reference is None:
            return np.full_like(self.v, np.nan)
        return self.model.difference(self.q, self.reference.q)

    @cached_property
    def kinetic_energy(self) -> Floats:
        """Of the bodies and the rotors (n + 1,) [J]."""
        with backend("reference", self.model) as bodies:
            turning = 0.5 * np.einsum("ki,ij,kj->k", self.v, self.rotors, self.v)
            return np.asarray(bodies.kinetic_energy(self.q, self.v) + turning)

    @cached_property
    def energy(self) -> Floats:
        """Kinetic and potential energy (n + 1,) [J], whichever engine moved the robot."""
        with backend("reference", self.model) as bodies:
            return np.asarray(self.kinetic_energy + bodies.potential_energy(self.q))

    def summary(self) -> Summary:
        """Errors, speeds, torques and the drift of the energy."""
        with np.errstate(invalid="ignore"):
            rms = np.sqrt(np.mean(self.error**2, axis=0))
        peak = float(np.max(self.kinetic_energy))
        drift = float(np.max(np.abs(self.energy - self.energy[0])))
        return Summary(
            rms_error=rms,
            max_error=np.max(np.abs(self.error), axis=0),
            max_speed=np.max(np.abs(self.v), axis=0),
            max_torque=np.max(np.abs(self.tau), axis=0, initial=0.0),
            energy_drift=drift / peak if peak else drift,
            saturated=float(np.mean(self.saturated.any(axis=1))) if len(self) else 0.0,
        )

    def first(self, n: int) -> Rollout:
        """The record of its first n steps."""
        if not 0 <= n <= len(self):
            raise ArgumentError(f"there are {len(self)} steps; wanted 0 to {len(self)} of them, not {n}")
        reference = None if self.reference is None else Setpoint(*(x[: n + 1] for x in self.reference))
        return Rollout(
            self.model,
            self.t[: n + 1],
            self.q[: n + 1],
            self.v[: n + 1],
            self.a[:n],
            self.tau[:n],
            self.saturated[:n],
            reference,
            self.rotors,
            self.settings,
        )

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file of the format that the name ends with: all of it, or nothing under that name.

        - ``.npz``: complete; `Rollout.load` reads it, and so does `numpy.load`
        - ``.csv``: a table for spreadsheets; `dynx.sim.record.csv_file` says what its columns are
        - ``.mcap``: ROS 2 messages for PlotJuggler, Foxglove and ``ros2 bag``; `dynx.sim.record.ros_topics`
          says what is on which topic

        All three keep every bit of the numbers. Raises ArgumentError for another format or a file that
        cannot be written, NotInstalledError for ``.mcap`` without mcap (``pip install 'dynx[mcap]'``).
        """
        from dynx.sim.record.formats import save

        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Rollout:
        """Read what `save` wrote as ``.npz``, the same to the last bit; ArgumentError for another file."""
        from dynx.sim.record.formats import load

        return load(path)

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """A `matplotlib.figure.Figure` of positions, errors, and torques against limits; saved at `path`.

        Without a reference it has velocities for errors. A limit is drawn where a torque comes near it.
        A floating base has a column of its own: its position in the world, and its error, velocity and
        force in its own axes. Raises NotInstalledError without matplotlib (``pip install 'dynx[plot]'``),
        ArgumentError for a file that cannot be written.
        """
        from dynx.sim.record.plot import plot

        return plot(self, path)

    def __repr__(self) -> str:
        return f"<Rollout of {self.model.name}: {len(self)} steps to {self.t[-1]:.6g} s>"
