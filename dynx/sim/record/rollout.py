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
        """Write the record to a file atomically, in the format of its suffix.

        - ``.npz``: complete; `Rollout.load` reads it, and so does `numpy.load`
        - ``.csv``: a table for spreadsheets; `dynx.sim.record.csv_file` describes its columns
        - ``.mcap``: ROS 2 messages for PlotJuggler, Foxglove and ``ros2 bag``; `dynx.sim.record.ros_topics`
          describes the topics

        All three keep every bit of the numbers. Raises ArgumentError for another format or a file that
        cannot be written, NotInstalledError for ``.mcap`` without mcap (``pip install 'dynx[mcap]'``).
        """
        save(self, path)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Rollout:
        """Read a ``.npz`` file that `save` wrote, to the last bit. Raises ArgumentError for any other
        file."""
        return cls(**load(path))

    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Plot positions, errors and torques with their limits; return the `matplotlib.figure.Figure`, and
        save it at `path` if that is given.

        Without a reference it shows velocities instead of errors. A limit is drawn where a torque comes near
        it. A floating base has its own column: its position in the world, and its error, velocity and force
        in the axes of the base. Raises NotInstalledError without matplotlib (``pip install 'dynx[plot]'``),
        ArgumentError for a file that cannot be written.
        """
        return plot(self, path)
