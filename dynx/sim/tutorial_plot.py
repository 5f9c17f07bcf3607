"""Plot of the errors of all modes of control over time."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.files.figures import new_figure, save_figure
from dynx.sim.tutorial import BULLET, Row, Tutorial

STYLES = ("-", "--", "-.", ":")
"""Line styles, so that curves can be distinguished without colour."""

LEAST = 1e-16
"""Smallest error on the logarithmic axis; smaller ones are rounding errors and are drawn there."""


def plot_rows(rows: Sequence[Row], tutorial: Tutorial, path: str | os.PathLike[str] | None = None) -> Any:
    """Plot the errors in a panel for each plant, save the figure at `path` and return it.

    The curves show the largest error of all joints at each time. Raises NotInstalledError without matplotlib
    (``pip install 'dynx[plot]'``), ArgumentError where the file cannot be written.
    """
    figure = new_figure(7.0, 2.0 + 3.2 * len(tutorial.plants))
    panels = figure.subplots(len(tutorial.plants), 1, sharex=True, sharey=True, squeeze=False)[:, 0]
    for axis, plant in zip(panels, tutorial.plants, strict=True):
        for k, row in enumerate(rows):
            rollout = row.outcomes[plant].rollout
            style: dict[str, Any] = {
                "color": f"C{k % 10}",
                "linestyle": STYLES[k % len(STYLES)],
                "lw": 1.3,
                "label": row.mode,
            }
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
