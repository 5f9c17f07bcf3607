"""Plot of the learning curves of ``dynx train``."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.files.figures import new_figure, save_figure
from dynx.training import Trained
from dynx.training.learning import CURVE, EVALUATIONS
from dynx.training.records import read_lines

_STYLES, _MARKS = ("-", "--", ":", "-."), "os^v"


def plot(runs: Sequence[Trained], path: str) -> None:
    """Plot the mean return of the last episodes, and each evaluation with its interval, over the steps."""
    figure = new_figure(7.0, 4.0)
    axes = figure.subplots()
    for k, run in enumerate(runs):
        colour, seed = f"C{k}", run.policy.spec.seed
        curve = read_lines(run.folder / CURVE)
        axes.plot(
            [each["steps"] for each in curve],
            [each["mean_return"] for each in curve],
            _STYLES[k % len(_STYLES)],
            color=colour,
            label=f"seed {seed}",
        )
        judged = read_lines(run.folder / EVALUATIONS)
        axes.plot(
            [each["steps"] for each in judged],
            [each["mean"] for each in judged],
            _MARKS[k % len(_MARKS)],
            color=colour,
            ms=5,
            mfc="none",
        )
    spec = runs[0].policy.spec
    axes.set_xlabel("steps")
    axes.set_ylabel("return: last 100 episodes (line), evaluation (mark)")
    axes.set_title(f"{spec.task.name}, {spec.algorithm}")
    axes.grid(True, alpha=0.3)
    axes.legend()
    save_figure(figure, path)
