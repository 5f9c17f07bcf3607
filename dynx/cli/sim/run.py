"""One simulation with progress, and the end of it also where it diverged or Ctrl-C came."""

from __future__ import annotations

import time

from dynx.cli.shell.exits import ANSWER_IS_NO, BAD_INPUT, DONE, INTERRUPTED, complain
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import console, echo_json
from dynx.cli.sim.document import document
from dynx.cli.sim.limits import limits_said
from dynx.cli.sim.outputs import Outputs
from dynx.cli.sim.request import Prepared
from dynx.cli.sim.tables import show
from dynx.errors import ArgumentError, DynxError, LimitError, SimulationError
from dynx.sim import Rollout, RolloutInterrupted, simulate


def run_sim(prepared: Prepared, outputs: Outputs, *, as_json: bool) -> int:
    """Simulate, write what there is and show it; the exit code."""
    ended: SimulationError | RolloutInterrupted | None = None
    started = time.perf_counter()
    with interruptible() as interruption:
        try:
            rollout = _simulated(prepared)
        except (SimulationError, RolloutInterrupted) as early:
            ended, rollout = early, early.rollout
        except KeyboardInterrupt:
            complain("interrupted before the first step")
            return interruption.code or INTERRUPTED
        except LimitError as error:
            raise ArgumentError(limits_said(error, prepared.model.name, ignorable=True)) from error
        seconds = time.perf_counter() - started
        interruption.finishing = True
        unwritten = _write(outputs, rollout)
        made = {**document(prepared, rollout, seconds, ended), "files": [] if unwritten else outputs.files}
        if as_json:
            echo_json(made)
        else:
            show(console(), made)
        if ended is not None:
            complain(f"{ended}{_kept(outputs, unwritten, goes_on=isinstance(ended, RolloutInterrupted))}")
        if unwritten is not None:
            complain(str(unwritten))
    if interruption.code is not None:
        return interruption.code
    if isinstance(ended, RolloutInterrupted):
        return INTERRUPTED
    if unwritten is not None:
        return BAD_INPUT
    return DONE if ended is None else ANSWER_IS_NO


def _simulated(prepared: Prepared) -> Rollout:
    with progress_bar(prepared.clock.n_steps, words="simulating") as advance:
        return simulate(
            prepared.model,
            prepared.law,
            prepared.motion.reference,
            **prepared.arguments,
            progress=lambda taken, wanted: advance(taken, "simulating"),
        )


def _write(outputs: Outputs, rollout: Rollout) -> DynxError | None:
    """Write the files; why not, where they cannot be. What is shown must not be lost by that."""
    try:
        outputs.write(rollout)
    except DynxError as error:
        return error
    return None


def _kept(outputs: Outputs, unwritten: DynxError | None, *, goes_on: bool) -> str:
    """Where to find what was computed until then, and how to go on where that makes sense."""
    if not outputs.save or unwritten is not None:
        return ""
    complete = [path for path in outputs.save if path.lower().endswith(".npz")]
    hint = f"; the same command with --resume {complete[0]} goes on" if goes_on and complete else ""
    return f"; what was computed is in {' and '.join(outputs.save)}{hint}"
