"""Plot of the samples of a sensor, a panel for each channel."""

from __future__ import annotations

import os
from typing import Any

from dynx.argument_types import checks_types
from dynx.files.figures import literal, new_figure, save_figure
from dynx.world.sensors.readings import Readings


@checks_types
def plot(readings: Readings, path: str | os.PathLike[str] | None = None) -> Any:
    """Plot the samples over the time at which they were taken; return the `matplotlib.figure.Figure`, and
    save it at `path` if that is given.

    Raises NotInstalledError without matplotlib (extra ``plot``), ArgumentError for a file that
    cannot be written.
    """
    channels = readings.sensor.channels
    figure = new_figure(7.0, 2.0 + 2.2 * len(channels))
    panels = figure.subplots(len(channels), 1, sharex=True, squeeze=False)[:, 0]
    for channel, panel in zip(channels, panels, strict=True):
        for k, component in enumerate(channel.components):
            rows = readings.channels[channel.name][:, k]
            label = component or channel.name
            panel.plot(readings.t, rows, color=f"C{k}", lw=0.8, marker=".", markersize=2.5, label=label)
        panel.set_ylabel(f"{channel.name.replace('_', ' ')} [{channel.unit}]")
        panel.grid(visible=True, color="0.9")
        if len(channel.components) > 1:
            panel.legend(fontsize=8, ncols=len(channel.components))
    panels[-1].set_xlabel("time [s]")
    figure.suptitle(literal(str(readings.sensor)), fontsize=11)
    if path is not None:
        save_figure(figure, path)
    return figure
