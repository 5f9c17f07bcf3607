"""Plot of ``dynx world --plot``: how far apart the motions of the engines are over time."""

from __future__ import annotations

import numpy as np

from dynx.files.figures import new_figure, save_figure
from dynx.world.comparison import WorldComparison

FLOOR = 1e-16
"""Smallest distance drawn [m]: the axis is logarithmic, and equal positions have none."""


def plot(comparison: WorldComparison, path: str) -> None:
    """Draw the distances between the engines, or for one engine the heights of what moves.

    Raises ArgumentError for a file that cannot be written, NotInstalledError without matplotlib.
    """
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    if comparison.separations:
        for each in comparison.separations:
            axes.semilogy(
                each.times, np.maximum(each.distance, FLOOR), lw=1.3, label=" - ".join(each.engines)
            )
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


def _plain(text: str) -> str:
    """Escape `text` so that matplotlib shows it literally."""
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")
