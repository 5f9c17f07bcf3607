"""`compare`: how far apart two motions of a kind are, and which differences of two scenarios cause it."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from inspect import signature
from typing import Any, overload

from dynx.errors import ArgumentError, DynxError, shown
from dynx.files.pages import html_grid
from dynx.model.numbers import is_real
from dynx.option_names import check_arguments
from dynx.sim.comparison.factors import Factor, Mixture
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.documents import Unknown
from dynx.sim.simulation import simulate
from dynx.world.comparison import WorldComparison, compare_engines
from dynx.world.scene.scene import Scene
from dynx.world.separation import Separation, separation

TOLERANCE = 1e-9
"""Default distance [rad or m] up to which two rollouts are alike: that of engines which add in another order
stays below it in most motions without contacts."""

MAX_FACTORS = 40
"""Largest number of differences that are examined one by one, with two reruns each."""

Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Cause:
    """A difference of the scenarios, and what it does to the motion."""

    factor: Factor
    alone: float | None
    """Largest distance [rad or m] between our rollout and one that differs from it by this factor alone;
    infinite where that one diverges, None where it cannot be simulated."""
    without: float | None
    """Largest distance between their rollout and one that has all of their factors but this."""
    obstacle: str | None = None
    """Why one of the two could not be simulated, or ended early."""

    def acts(self, tolerance: float) -> bool:
        """Return True if the factor moves either rollout by more than `tolerance`."""
        return any(each is not None and each > tolerance for each in (self.alone, self.without))


@dataclass(frozen=True, eq=False)
class RolloutComparison:
    """Two rollouts, their distance over time, and the causes of it."""

    ours: Rollout
    theirs: Rollout
    separation: Separation
    tolerance: float
    """Distance up to which rollouts are alike [rad or m]."""
    causes: tuple[Cause, ...]
    """All differences of the scenarios, the one with the largest effect first."""
    remaining: float | None
    """Largest distance between their rollout and a rerun of our scenario with all differences taken over;
    None where it cannot be simulated."""
    repeated: float | None
    """Largest distance between our rollout and a rerun of its own scenario; None where it cannot be
    simulated."""
    notes: tuple[str, ...]

    @property
    def alike(self) -> bool:
        """True if nothing is farther apart than the tolerance."""
        return self.separation.largest <= self.tolerance

    @property
    def proved(self) -> bool:
        """True if the rollouts part, and taking over the causes removes the distance."""
        reruns = (self.remaining, self.repeated)
        return not self.alike and all(each is not None and each <= self.tolerance for each in reruns)

    def __repr__(self) -> str:
        if self.alike:
            return f"<RolloutComparison: alike to {self.separation.largest:.2g}>"
        acting = sum(cause.acts(self.tolerance) for cause in self.causes)
        proof = "proved" if self.proved else "not proved"
        count = f"{acting} of {len(self.causes)} differences"
        return f"<RolloutComparison: {self.separation.largest:.3g} apart, causes: {count}, {proof}>"

    def _repr_html_(self) -> str:
        rows = (
            (
                each.factor.name,
                each.factor.ours,
                each.factor.theirs,
                *("" if effect is None else f"{effect:.2g}" for effect in (each.alone, each.without)),
            )
            for each in self.causes
        )
        return html_grid(repr(self)[1:-1], ("difference", "ours", "theirs", "alone", "without it"), rows)


@overload
def compare(
    ours: Rollout,
    theirs: Rollout,
    *,
    tolerance: float = TOLERANCE,
    rerun: bool = True,
    progress: Progress | None = None,
) -> RolloutComparison: ...
@overload
def compare(
    ours: Scene, theirs: Sequence[str], duration: float, dt: float = 1e-3, **options: Any
) -> WorldComparison: ...
def compare(ours: Any, theirs: Any, *given: Any, **options: Any) -> Any:
    """Find out how far apart two motions are.

    - ``compare(rollout, rollout, tolerance=, rerun=, progress=)``: two rollouts of a robot, or logs that
      `Rollout.load` reads, and why they part: the differences of their scenarios (`RolloutComparison`).
    - ``compare(scene, engines, duration, dt=1e-3, substeps=, settings=, samples=, finish=, progress=)``: the
      motions of one scene in the worlds of several engines (`dynx.world.WorldComparison`).

    Each difference of two scenarios (an argument of `simulate`, a gain, a link, a joint) is taken over from
    `theirs` into `ours` alone, and simulated again; and so are all differences but this one. With all of
    them the rerun must be `theirs` again, which is the proof that nothing else is a cause. `tolerance` is the
    distance [rad or m] up to which rollouts are alike. Without `rerun` the differences are listed only.
    `progress` is called with the number of reruns done and their total number.

    The engines run the scene for `duration` [s] in steps of `dt` / `substeps` [s], with the `settings` of
    `World` by engine; states are compared at `samples` times. `finish` is called with each world at its end,
    and `progress` with the name of the engine and the time reached. An engine that fails in a step ends its
    run there.

    Raises ArgumentError for rollouts of robots with other coordinates or without a common time, for anything
    but two rollouts or a scene with its engines, and for an invalid tolerance; UnknownNameError for an option
    of another name, TypeError for other arguments that do not fit; the errors of `World` for a scene that
    cannot be opened.
    """
    comparing = compare_engines if isinstance(ours, Scene) else _compare_rollouts
    check_arguments("compare", signature(comparing), (ours, theirs, *given), options)
    return comparing(ours, theirs, *given, **options)


def rollout_separation(ours: Rollout, theirs: Rollout) -> Separation:
    """Measure how far apart two rollouts are over time, in the coordinates of their robot and the positions
    of the bodies that both have.

    Raises ArgumentError for rollouts of robots with other coordinates, or without a common time.
    """
    one, other = ours.model, theirs.model
    if (one.base, one.joint_names) != (other.base, other.joint_names):
        raise ArgumentError(
            "the rollouts have other coordinates: "
            f"{one.base} base and joints {', '.join(one.joint_names) or 'none'}; "
            f"{other.base} base and joints {', '.join(other.joint_names) or 'none'}"
        )
    return separation(ours.record("the first rollout"), theirs.record("the second rollout"))


def _compare_rollouts(
    ours: Rollout,
    theirs: Rollout,
    *,
    tolerance: float = TOLERANCE,
    rerun: bool = True,
    progress: Progress | None = None,
) -> RolloutComparison:
    for name, each in (("first", ours), ("second", theirs)):
        if not isinstance(each, Rollout):
            raise ArgumentError(
                f"the {name} rollout is of type {type(each).__name__}; wanted a dynx.Rollout, which "
                "simulate returns and Rollout.load reads, or first a Scene and second its engines"
            )
    if not is_real(tolerance) or not 0.0 <= tolerance < math.inf:
        raise ArgumentError(f"tolerance is {shown(tolerance)}; wanted a number of rad or m, 0 or more")
    apart = rollout_separation(ours, theirs)
    notes = [*_departures("the first", ours), *_departures("the second", theirs)]
    if ours.scenario is None or theirs.scenario is None:
        which = " and ".join(
            name for name, each in (("first", ours), ("second", theirs)) if each.scenario is None
        )
        notes.append(f"the {which} rollout has no scenario, so that differences cannot be listed or proved")
        return RolloutComparison(ours, theirs, apart, tolerance, (), None, None, tuple(notes))
    mixture = Mixture(ours.scenario, theirs.scenario)
    names = [factor.name for factor in mixture.factors]
    causes = [Cause(factor, None, None) for factor in mixture.factors]
    remaining = repeated = None
    if rerun and apart.largest > tolerance:
        trials = _Trials(mixture, float(apart.times[-1]), progress)
        repeated, first = trials.distance((), ours)
        remaining, last = trials.distance(names, theirs)
        reruns = (("the first", first), ("the second", last))
        notes += [f"a rerun of {which}: {why}" for which, why in reruns if why]
        if len(names) > MAX_FACTORS:
            notes.append(f"{len(names)} differences are too many to be examined one by one ({MAX_FACTORS})")
        else:
            causes = [trials.cause(factor, names) for factor in mixture.factors]
            causes.sort(key=lambda each: -max(each.alone or 0.0, each.without or 0.0))
    return RolloutComparison(ours, theirs, apart, tolerance, tuple(causes), remaining, repeated, tuple(notes))


class _Trials:
    """Reruns of mixed scenarios; each is simulated once."""

    def __init__(self, mixture: Mixture, duration: float, progress: Progress | None) -> None:
        self._mixture, self._duration, self._progress = mixture, duration, progress
        self._total = _number_of_reruns(len(mixture.factors))
        self._known: dict[frozenset[str], tuple[Rollout | None, str | None]] = {}

    def cause(self, factor: Factor, names: Collection[str]) -> Cause:
        """Return the factor with its effects on both rollouts."""
        base, _ = self._rollout(())
        every, _ = self._rollout(names)
        alone, first = (None, None) if base is None else self.distance((factor.name,), base)
        rest = [name for name in names if name != factor.name]
        without, last = (None, None) if every is None else self.distance(rest, every)
        return Cause(factor, alone, without, first or last)

    def distance(self, taken: Collection[str], record: Rollout) -> tuple[float | None, str | None]:
        """Return the largest distance of a rerun from a record, and why it is not known or not finite."""
        found, why = self._rollout(taken)
        if found is None:
            return None, why
        return (float("inf") if why is not None else rollout_separation(found, record).largest), why

    def _rollout(self, taken: Collection[str]) -> tuple[Rollout | None, str | None]:
        key = frozenset(taken)
        if key not in self._known:
            self._known[key] = self._simulated(taken)
        return self._known[key]

    def _simulated(self, taken: Collection[str]) -> tuple[Rollout | None, str | None]:
        try:
            return simulate(self._mixture.scenario(taken, self._duration)), None
        except DynxError as error:
            partial = getattr(error, "rollout", None)
            return (partial if isinstance(partial, Rollout) and len(partial) else None), str(error)
        finally:
            if self._progress is not None:
                self._progress(len(self._known) + 1, self._total)


def _number_of_reruns(n: int) -> int:
    """Return how many scenarios there are with none, one, all but one and all of n differences."""
    if n > MAX_FACTORS:
        return 2
    return 2 + 2 * n if n > 2 else 2**n


def _departures(name: str, rollout: Rollout) -> list[str]:
    """Return notes on what makes a record differ from its scenario."""
    notes = [f"{name} rollout departs from its scenario: {each}" for each in rollout.departures]
    scenario = rollout.scenario
    if scenario is not None and isinstance(scenario.controller, Unknown):
        notes.append(f"the controller of {name} rollout cannot be rebuilt from its file")
    return notes
