"""Plan of the defects planted into each robot: equal for equal seeds, on any machine."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from tests.doctor.planting.catalogue import PLANTERS
from tests.doctor.planting.robots import ROBOTS, bases, clean_skeleton, clean_text
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Site

ATTEMPTS = 8
"""Draws in one robot before the next is taken: not every draw of a pair leaves room for both."""


@dataclass(frozen=True)
class Trial:
    """Defects of these rules, one after the other, in a robot on a base; `seed` selects the places."""

    rules: tuple[str, ...]
    robot: str
    base: Base
    seed: int

    def __str__(self) -> str:
        return f"{'+'.join(self.rules)} in {self.robot}, {self.base} (seed {self.seed})"


def plant_defects(trial: Trial) -> list[PlantedDefect]:
    """Plant the defects of a trial, each in the text of the one before; CannotPlant without room."""
    rng = Random(f"{trial.rules} {trial.robot} {trial.base} {trial.seed}")
    source = XmlSource(clean_text(trial.robot, trial.base), f"{trial.robot}.urdf")
    skeleton = clean_skeleton(trial.robot, trial.base)
    found: list[PlantedDefect] = []
    for rule in trial.rules:
        planter = PLANTERS[rule]
        if trial.base not in planter.bases:
            raise CannotPlant(f"{rule} is no defect on the {trial.base} base")
        taken = found[-1].touched if found else frozenset()
        found.append(planter.plant(Site(source, skeleton, rng, taken)))
        source = found[-1].source
    return found


def single_trials(
    rules: Sequence[str], robots: int, seed: int = 0, among: Sequence[str] = ROBOTS
) -> Iterator[Trial]:
    """Plan each rule in `robots` different robots, on a random base."""
    for rule in rules:
        rng = Random(f"{rule} {seed}")
        order = rng.sample(among, len(among))
        count = 0
        for robot in order:
            if count == robots:
                break
            trial = _with_room((rule,), robot, rng, seed)
            if trial is not None:
                count += 1
                yield trial


def pair_trials(
    rules: Sequence[str], pairs: int, seed: int = 0, among: Sequence[str] = ROBOTS
) -> Iterator[Trial]:
    """Plan pairs of different rules: each rule in at least `pairs`, and no pair twice.

    Rules whose defect hides others are in none.
    """
    rng = Random(f"pairs {seed}")
    rules = [rule for rule in rules if not PLANTERS[rule].alone]
    counts = Counter(dict.fromkeys(rules, 0))
    seen: set[frozenset[str]] = set()
    while (rule := min(counts, key=lambda each: counts[each])) and counts[rule] < pairs:
        others = sorted(rng.sample(rules, len(rules)), key=lambda each: counts[each])
        for other in others:
            if other == rule or frozenset((rule, other)) in seen:
                continue
            both = (rule, other) if rng.random() < 0.5 else (other, rule)
            trials = (_with_room(both, robot, rng, seed) for robot in rng.sample(among, len(among)))
            trial = next((each for each in trials if each is not None), None)
            seen.add(frozenset(both))
            if trial is not None:
                counts.update(both)
                yield trial
                break
        else:
            raise AssertionError(f"{rule} finds no partner any more")


def _with_room(rules: tuple[str, ...], robot: str, rng: Random, seed: int) -> Trial | None:
    for base in rng.sample(bases(robot), len(bases(robot))):
        for attempt in range(ATTEMPTS):
            trial = Trial(rules, robot, base, 1000 * seed + attempt)
            try:
                plant_defects(trial)
            except CannotPlant:
                continue
            return trial
    return None
