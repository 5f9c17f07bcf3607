"""Plot of ``dynx world --plot``: how far apart the motions of the engines are over time."""

from __future__ import annotations

import numpy as np

from dynx.files.figures import new_figure, save_figure
from dynx.world.comparison import WorldComparison

FLOOR = 1e-9
"""Smallest distance drawn [m], unless all are smaller: below it there is rounding alone."""

SPAN = 1e-4
"""Smallest distance drawn, relative to the largest, where all are below `FLOOR`."""


def plot(comparison: WorldComparison, path: str) -> None:
    """Draw the distances between the engines, or for one engine the heights of what moves.

    Raises ArgumentError for a file that cannot be written, NotInstalledError without matplotlib.
    """
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    if comparison.separations:
        bottom = _lowest(max(float(each.distance.max()) for each in comparison.separations))
        for each in comparison.separations:
            distance = np.maximum(each.distance, bottom)
            axes.semilogy(each.times, distance, lw=1.3, label=" - ".join(each.records))
        axes.set_ylim(bottom=bottom)
        axes.set_ylabel("largest distance [m]")
    else:
        run = comparison.runs[0]
        for body in comparison.scene.bodies:
            if not body.fixed:
                heights = [state.bodies[body.name].T_world_body[2, 3] for state in run.states]
                axes.plot(run.times, heights, lw=1.3, label=_plain(body.name))
        for robot in comparison.scene.robots:
            if robot.model.floating:
                heights = [state.robots[robot.name].q[2] for state in run.states]
                axes.plot(run.times, heights, lw=1.3, label=_plain(robot.name))
        axes.set_ylabel("height [m]")
    axes.set_xlabel("time [s]")
    axes.set_title(_plain(comparison.scene.name), fontsize=11)
    axes.grid(visible=True, color="0.9")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize=8)
    save_figure(figure, path)


def _lowest(largest: float) -> float:
    """Return the lower limit of the logarithmic axis for a largest distance [m]."""
    return FLOOR if largest > FLOOR or largest == 0.0 else SPAN * largest


def _plain(text: str) -> str:
    """Escape `text` so that matplotlib shows it literally."""
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")
