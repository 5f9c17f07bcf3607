"""Outcome of a batch of rollouts."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.files.arrays import SCHEMA_ENTRY, read_arrays, write_arrays
from dynx.files.figures import literal, new_figure, save_figure
from dynx.model import Model
from dynx.model.numbers import checked_entries, real_array
from dynx.rbd.jacobians import LOCAL
from dynx.registry import door
from dynx.sim.record.csv_file import coordinate_names
from dynx.sim.scenario.scenario import RecordedScenario, Scenario
from dynx.spatial.scalar import Floats

SCHEMA = "dynx.rollouts/2"
"""Schema name of the file."""

OWN_PARAMETERS = "own_parameters"
"""Name of the text in the file that says whether rollouts had parameters of their own."""


@dataclass(frozen=True, eq=False)
class BatchRollouts:
    """The outcome of n rollouts, one in each row; rows that were not computed are NaN.

    Errors are `model.difference` from the configuration at the end of each step to the reference there. The
    record has the states after every `record_every` steps, and the torque of the step before.

    `diverged` is the time [s] at which a step begins, after which the velocity is not finite or has a norm
    above 1e8 rad/s or m/s. `simulate` raises an error with this `time`. It is a multiple of `dt`, and NaN for
    rollouts that did not diverge. A diverged rollout counts as done: it takes the remaining steps, and its
    states and errors are in general not finite.
    """

    scenario: Scenario  # shared by all rollouts, without the arguments that have a row for each rollout
    q: Floats  # (n, nq), at the end
    v: Floats  # (n, nv), at the end
    max_error: Floats  # (n, nv)
    rms_error: Floats  # (n, nv)
    diverged: Floats  # (n,), the time [s] of the step that led to divergence; NaN if there was none
    done: Any  # (n,) bool
    t: Floats  # (kept,), the times of the record [s]
    q_record: Floats  # (n, kept, nq)
    v_record: Floats  # (n, kept, nv)
    tau_record: Floats  # (n, kept, nv)
    saturated: Floats  # (n, nv), the share of steps at the effort limit
    own_parameters: bool | None = False
    """True if rollouts had `parameters` of their own, which are not recorded; None if a file does not state
    it."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints of the robot."""
        return tuple(self.scenario.model.joint_names)

    @property
    def dt(self) -> float:
        """Length of a step [s]."""
        return self.scenario.dt

    def __len__(self) -> int:
        return len(self.q)

    @property
    def worst(self) -> Floats:
        """The largest error of any joint at any time (n,); infinite where a rollout diverged."""
        worst = np.max(self.max_error, axis=1, initial=0.0)
        return np.where(np.isnan(self.diverged), worst, np.where(self.done, np.inf, np.nan))

    @checks_types
    def quantiles(self, levels: Sequence[float] = (0.05, 0.5, 0.95)) -> Floats:
        """Return the quantiles (len(levels),) of `worst` over the computed rollouts; NaN without any."""
        shares = checked_entries("levels", real_array("levels", levels))
        if shares.ndim != 1 or (shares < 0.0).any() or (shares > 1.0).any():
            raise ArgumentError(f"levels is {shown(levels)}; wanted a sequence of numbers from 0 to 1")
        worst = self.worst[self.done]
        if not len(worst):
            return np.full(len(levels), np.nan)
        return np.asarray(np.quantile(worst, shares, method="inverted_cdf"))

    def columns(self) -> dict[str, Any]:
        """Return columns (n,) with a row for each rollout, by name, for `pandas.DataFrame`.

        They are `done`, `diverged` and `worst`, and of each coordinate the largest and the RMS error, the
        last position and velocity, and the share of steps at the effort limit.
        """
        positions, rates = coordinate_names(self.scenario.model)
        found: dict[str, Any] = {"done": self.done, "diverged": self.diverged, "worst": self.worst}
        blocks = {
            "max_error": (rates, self.max_error),
            "rms_error": (rates, self.rms_error),
            "q": (positions, self.q),
            "v": (rates, self.v),
            "saturated": (rates, self.saturated),
        }
        for kind, (names, block) in blocks.items():
            found |= {f"{kind}:{name}": column for name, column in zip(names, block.T, strict=True)}
        return found

    @door("dynx.sim.batch_wrenches:joint_wrenches_of")
    def joint_wrenches(
        self, *, frame: str | None = None, reference: str = LOCAL, models: Sequence[Model] | None = None
    ) -> Floats:
        """Return the wrenches (n, kept - 1, n_joints, 6) that joints transmit in each recorded step."""
        raise NotImplementedError

    @door("dynx.sim.batch_wrenches:base_wrench_of")
    def base_wrench(
        self, *, frame: str | None = None, reference: str = LOCAL, models: Sequence[Model] | None = None
    ) -> Floats:
        """Return the wrench (n, kept - 1, 6) that the world exerts on the root link in each recorded step."""
        raise NotImplementedError

    @checks_types
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a ``.npz`` that `load` reads, atomically.

        Raises ArgumentError for another name or a file that cannot be written.
        """
        if Path(path).suffix != ".npz":
            raise ArgumentError(f"rollouts are saved as .npz, not as {shown(Path(path).name)}")
        arrays = {name: getattr(self, name) for name in _array_names()}
        known = {} if self.own_parameters is None else {OWN_PARAMETERS: str(self.own_parameters)}
        write_arrays(path, {SCHEMA_ENTRY: SCHEMA, "scenario": self.scenario.to_json(), **known, **arrays})

    @classmethod
    @checks_types
    def load(cls, path: str | os.PathLike[str]) -> BatchRollouts:
        """Read what `save` wrote. Raises ArgumentError for any other file."""
        file = read_arrays(path, "rollouts", SCHEMA)
        try:
            scenario = Scenario.from_json(file.text("scenario"))
        except ArgumentError as error:
            raise ArgumentError(f"the scenario in {file.path} cannot be read: {error}") from error
        n, kept = len(file.array("done", (None,), bool)), len(file.array("t", (None,)))
        nq, nv = scenario.model.nq, scenario.model.nv
        shapes: dict[str, tuple[int, ...]] = {"t": (kept,), "done": (n,), "diverged": (n,), "q": (n, nq)}
        shapes |= dict.fromkeys(("v", "max_error", "rms_error", "saturated"), (n, nv))
        shapes |= {"q_record": (n, kept, nq)} | dict.fromkeys(("v_record", "tau_record"), (n, kept, nv))
        arrays = {
            name: file.array(name, shape, bool if name == "done" else float) for name, shape in shapes.items()
        }
        own = {"True": True, "False": False}.get(file.texts.get(OWN_PARAMETERS, ""))
        return cls(scenario, **arrays, own_parameters=own)

    @checks_types
    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Plot the share of rollouts below each error, and the errors of each joint; return the `matplotlib`
        figure.

        Raises NotInstalledError without matplotlib (extra ``plot``).
        """
        figure = new_figure(7.0, 6.0)
        upper, lower = figure.subplots(2, 1)
        worst = np.sort(self.worst[np.isfinite(self.worst)])
        upper.step(
            worst, np.arange(1, len(worst) + 1) / max(int(self.done.sum()), 1), where="post", color="C0"
        )
        upper.set_ylim(0.0, 1.02)
        upper.set_xlabel("largest error of any joint [rad or m]")
        upper.set_ylabel("share of rollouts below")
        sound = self.done & np.isnan(self.diverged)
        lower.boxplot(
            self.max_error[sound],
            tick_labels=[*map(literal, self.joint_names)],
            whis=(5, 95),
            showfliers=False,
        )
        lower.set_ylabel("largest error [rad or m]")
        lower.tick_params(axis="x", rotation=30)
        if _spans_decades(worst):
            upper.set_xscale("log")
        if _spans_decades(self.max_error[sound]):
            lower.set_yscale("log")
        for axis in (upper, lower):
            axis.grid(visible=True, color="0.9")
        figure.suptitle(f"{int(self.done.sum())} of {len(self)} rollouts{self._losses}")
        if path is not None:
            save_figure(figure, path)
        return figure

    @door("dynx.viewer.viewer:view")
    def view(self, **options: Any) -> Any:
        """Play the recorded states of all rollouts in the browser; return the `dynx.viewer.Viewer`, which
        takes the options.

        Raises ArgumentError for a batch without a record, and NotInstalledError without the extra ``viewer``.
        """
        raise NotImplementedError

    @property
    def _losses(self) -> str:
        """Number of diverged rollouts and the first time, as the end of a sentence; empty without any."""
        lost = int((~np.isnan(self.diverged)).sum())
        return f", {lost} diverged, the first at {np.nanmin(self.diverged):.6g} s" if lost else ""

    def __repr__(self) -> str:
        done = f"{int(np.sum(self.done))} of {len(self)} done"
        return f"<BatchRollouts of {self.scenario.model.name}: {done}{self._losses}>"

    def _repr_html_(self) -> str:
        low, middle, high = (f"{x:.3g}" for x in self.quantiles())
        rows = {
            "done": f"{int(np.sum(self.done))} of {len(self)}",
            "diverged": self._losses.removeprefix(", ") or "none",
            "largest error [rad or m], 5 %, 50 %, 95 %": f"{low}, {middle}, {high}",
        }
        from dynx.files.pages import html_table  # most are shown on no page

        return html_table(f"rollouts of {self.scenario.model.name}", rows)


# Not in the class, where it would be a default.
setattr(BatchRollouts, "scenario", RecordedScenario())  # noqa: B010


def _spans_decades(errors: Floats) -> bool:
    """Check whether the largest error is 100 times the smallest that is not zero, or more."""
    present = errors[errors > 0.0]
    return bool(present.size) and float(present.max()) >= 100.0 * float(present.min())


def _array_names() -> list[str]:
    return [field.name for field in fields(BatchRollouts) if field.name not in ("scenario", OWN_PARAMETERS)]
