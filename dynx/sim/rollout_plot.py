"""A rollout on one page: where the joints went, what was missing, what the motors gave."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.errors import NotInstalledError

if TYPE_CHECKING:
    from dynx.sim.rollout import Rollout

STYLES = ("-", "--", "-.", ":")
"""Told apart without colour too."""


def plot(rollout: Rollout, path: str | os.PathLike[str] | None) -> Any:
    """See `Rollout.plot`. The figure belongs to no window and no global state of matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise NotInstalledError("a plot needs matplotlib: pip install 'dynx[plot]'") from error
    model = rollout.model
    base_q, base_v = (7, 6) if model.floating else (0, 0)
    figure = Figure(figsize=(7.0, 8.0), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    t, begun = rollout.t, rollout.t[:-1]
    for k, name in enumerate(model.joint_names):
        style: dict[str, Any] = {"color": f"C{k % 10}", "linestyle": STYLES[k % len(STYLES)], "lw": 1.3}
        axes[0].plot(t, rollout.q[:, base_q + k], label=name, **style)
        if rollout.reference is not None:
            axes[0].plot(t, rollout.reference.q[:, base_q + k], color="0.6", lw=0.8, zorder=0)
            axes[1].plot(t, rollout.error[:, base_v + k], **style)
        axes[2].step(begun, rollout.tau[:, base_v + k], where="post", **style)
        _limits(axes[2], float(model.effort_limit[base_v + k]), rollout.tau[:, base_v + k], f"C{k % 10}")
    axes[0].set_ylabel("joints [rad or m]")
    axes[1].set_ylabel("error [rad or m]")
    axes[2].set_ylabel("torques [N m or N]")
    axes[2].set_xlabel("time [s]")
    if rollout.reference is None:
        axes[1].text(0.5, 0.5, "no reference", transform=axes[1].transAxes, ha="center", color="0.4")
    for axis in axes:
        axis.grid(visible=True, color="0.9")
    law = rollout.settings.get("controller", "")
    figure.suptitle(f"{model.name}: {law} on {rollout.settings.get('plant', 'plant')}", fontsize=11)
    figure.legend(loc="outside lower center", ncols=min(4, max(1, len(model.joint_names))), fontsize=8)
    if path is not None:
        figure.savefig(path, dpi=200)
    return figure


def _limits(axis: Any, limit: float, tau: Any, color: str) -> None:
    """A motor's limits, where the torque came near enough that they fit the picture."""
    if np.isfinite(limit) and np.max(np.abs(tau), initial=0.0) > 0.5 * limit:
        axis.axhline(limit, color=color, lw=0.8, ls=(0, (1, 3)))
        axis.axhline(-limit, color=color, lw=0.8, ls=(0, (1, 3)))
