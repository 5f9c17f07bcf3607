"""The record of one simulation, with its files and its plot."""

from __future__ import annotations

import os
from typing import Any

from dynx.model import Model
from dynx.registry import door
from dynx.sim.record.csv_file import columns
from dynx.sim.record.formats import load, save
from dynx.sim.record.plot import plot
from dynx.sim.record.rollout_data import RolloutData


class Rollout(RolloutData):
    """The record of one simulation: its data (`RolloutData`), columns, files and plot."""

    save = save
    plot = plot
    columns = columns

    @door("dynx.viewer.viewer:view")
    def view(self, **options: Any) -> Any:
        """Play the rollout in the browser; return the `dynx.viewer.Viewer`, which takes the options.

        Raises NotInstalledError without the extra ``viewer``.
        """
        raise NotImplementedError

    @classmethod
    def load(cls, path: str | os.PathLike[str], model: Model | None = None) -> Rollout:
        """Read a file of `save`: ``.npz`` to the last bit, or ``.mcap``, which has times in whole
        nanoseconds and neither scenario nor surroundings.

        A ``.csv`` of `save`, or the log of a robot from elsewhere, is read as a rollout of `model`: its
        columns are ``t`` and ``q:JOINT``, and where they are known ``v:JOINT``, ``a:JOINT`` and ``tau:JOINT``
        (`dynx.sim.record.csv_file.load_csv`).

        Raises ArgumentError for any other file, NotInstalledError for ``.mcap`` without mcap.
        """
        return cls(**load(path, model))
