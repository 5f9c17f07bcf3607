"""The record of one simulation, with its files and its plot."""

from __future__ import annotations

import os
from typing import Any

from dynx.sim.record.formats import load, save
from dynx.sim.record.plot import plot
from dynx.sim.record.rollout_data import RolloutData


class Rollout(RolloutData):
    """The record of one simulation: its data (`RolloutData`), files and plot."""

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file of the format that the name ends with: all of it, or nothing under that name.

        - ``.npz``: complete; `Rollout.load` reads it, and so does `numpy.load`
        - ``.csv``: a table for spreadsheets; `dynx.sim.record.csv_file` says what its columns are
        - ``.mcap``: ROS 2 messages for PlotJuggler, Foxglove and ``ros2 bag``; `dynx.sim.record.ros_topics`
          says what is on which topic

        All three keep every bit of the numbers. Raises ArgumentError for another format or a file that
        cannot be written, NotInstalledError for ``.mcap`` without mcap (``pip install 'dynx[mcap]'``).
        """
        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Rollout:
        """Read what `save` wrote as ``.npz``, the same to the last bit; ArgumentError for another file."""
        return cls(**load(path))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Return a `matplotlib.figure.Figure` of positions, errors, and torques against limits; saved at
        `path`.

        Without a reference it has velocities for errors. A limit is drawn where a torque comes near it.
        A floating base has a column of its own: its position in the world, and its error, velocity and
        force in its own axes. Raises NotInstalledError without matplotlib (``pip install 'dynx[plot]'``),
        ArgumentError for a file that cannot be written.
        """
        return plot(self, path)
