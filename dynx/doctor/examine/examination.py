"""One file in several engines: each engine's answers, and how far they are from the right ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from dynx.doctor.examine.engine_input import without_meshes, written
from dynx.doctor.examine.right_answers import Truth, draw_states, find_truth, free_model
from dynx.engines.silence import silence
from dynx.errors import DynxError
from dynx.loaded import LoadedModel, LoadedRobot, loader_class
from dynx.rules.case import Case
from dynx.spatial.scalar import Floats

KINEMATICS, JACOBIAN = "forward_kinematics", "jacobian"
MASS, TORQUE, ACCELERATION = "mass_matrix", "inverse_dynamics", "forward_dynamics"
LOADING = "loading"
"""In the place of a quantity, for an engine that refuses the file."""

QUANTITIES = (KINEMATICS, JACOBIAN, MASS, TORQUE, ACCELERATION)
"""What is compared; forward dynamics by its backward error, the torque that the answer really takes."""


@dataclass(frozen=True, eq=False)
class Answers:
    """What one engine makes of one file.

    `deviation` maps a quantity to engine less truth: by link (n, 4, 4) or (n, 6, nv) for poses and
    Jacobians, under "" (n, nv, nv) or (n, nv) for the rest, (n, 2, nv) for accelerations. A quantity
    the engine failed to answer is in `failed`, with its words; `refused` says why it did not load the
    file at all.
    """

    engine: str
    refused: str | None = None
    deviation: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)
    description: LoadedModel | None = None

    def take(self, count: int) -> Answers:
        """The same at the first `count` states alone."""
        cut = {
            quantity: {part: gap[:count] for part, gap in parts.items()}
            for quantity, parts in self.deviation.items()
        }
        return replace(self, deviation=cut)


@dataclass(frozen=True, eq=False)
class Examination:
    """The answers of all engines to one case; `truth` is that of the case's own text."""

    truth: Truth
    answers: Mapping[str, Answers]

    def take(self, count: int) -> Examination:
        """The same at the first `count` states alone."""
        return Examination(
            self.truth.take(count), {name: each.take(count) for name, each in self.answers.items()}
        )

    def scale(self, quantity: str, engine: str) -> float:
        """What a deviation is divided by: the largest right value, or the largest of the engine's.

        A backward error is relative already.
        """
        if quantity == ACCELERATION:
            return 1.0
        truth = self.truth
        right = {
            KINEMATICS: truth.poses,
            JACOBIAN: np.stack(list(truth.jacobians.values())) if truth.jacobians else np.zeros(1),
            MASS: truth.mass_matrix,
            TORQUE: truth.torque,
        }[quantity]
        largest = float(np.max(np.abs(right), initial=0.0))
        if largest > 0.0:
            return largest
        own = self.answers[engine].deviation.get(quantity, {})
        return _largest(own) or 1.0

    def error(self, engine: str, quantity: str) -> float:
        """Largest deviation over its scale; infinite where there is no answer."""
        answers = self.answers[engine]
        if answers.refused is not None or quantity in answers.failed:
            return float("inf")
        return _number(_largest(answers.deviation.get(quantity, {})) / self.scale(quantity, engine))

    def errors(self, engine: str) -> dict[str, float]:
        """`error` of every quantity that was asked; empty where the file was refused."""
        answers = self.answers[engine]
        if answers.refused is not None:
            return {}
        asked = [quantity for quantity in QUANTITIES if quantity in {*answers.deviation, *answers.failed}]
        return {quantity: self.error(engine, quantity) for quantity in asked}

    def worst(self, engine: str) -> float:
        """The largest of `errors`, infinite where the file was refused."""
        if self.answers[engine].refused is not None:
            return float("inf")
        return max(self.errors(engine).values(), default=0.0)

    def joint_errors(self, engine: str, other: str | None = None) -> dict[str, float]:
        """Inverse dynamics joint by joint, against the truth or another engine, over the joint's
        largest right torque (at least 1e-9 of the largest of all)."""
        mine = self.answers[engine].deviation.get(TORQUE, {}).get("")
        theirs = None if other is None else self.answers[other].deviation.get(TORQUE, {}).get("")
        if mine is None or (other is not None and theirs is None):
            return {}
        gap = np.max(np.abs(mine if theirs is None else mine - theirs), axis=0, initial=0.0)
        right = np.max(np.abs(self.truth.torque), axis=0, initial=0.0)
        size = np.maximum(right, 1e-9 * np.max(right, initial=0.0))
        ratio = np.where(gap > 0.0, gap / np.where(size > 0.0, size, 1.0), 0.0)
        return dict(zip(coordinate_names(self.truth), ratio.tolist(), strict=True))

    def pair_error(self, engine: str, other: str, quantity: str) -> float:
        """Two engines against each other."""
        one, two = self.answers[engine], self.answers[other]
        if quantity in {*one.failed, *two.failed} or one.refused or two.refused:
            return float("inf")
        gap = change(one.deviation.get(quantity, {}), two.deviation.get(quantity, {}))
        return _number(gap / self.scale(quantity, engine))


class Laboratory:
    """Examines cases of one robot: the same engines, number of states and seed for all of them."""

    def __init__(self, engines: Collection[str], samples: int, seed: int) -> None:
        self.engines = {name: loader_class(name) for name in engines}
        self._samples = samples
        self._seed = seed

    def truth(self, case: Case) -> Truth:
        """The right answers for a case."""
        model = free_model(case.source, case.base)
        return find_truth(model, draw_states(model, self._samples, self._seed))

    def examine(
        self,
        case: Case,
        engines: Collection[str] | None = None,
        *,
        truth: Truth | None = None,
        describe: bool = False,
    ) -> Examination:
        """Let the engines load the text of the case and answer; `truth` spares finding it again."""
        truth = truth or self.truth(case)
        chosen = [name for name in self.engines if engines is None or name in engines]
        with written(without_meshes(case.source)) as path:
            found = {name: self._asked(name, path, case, truth, describe) for name in chosen}
        return Examination(truth, found)

    def _asked(self, engine: str, path: Path, case: Case, truth: Truth, describe: bool) -> Answers:
        try:
            # Engines announce on the streams of the process what is reported here in better order.
            with (
                silence(),
                np.errstate(all="ignore"),
                self.engines[engine](path, truth.model, case.calls) as robot,
            ):
                return _answers(engine, robot, truth, describe)
        except DynxError as error:
            # The name of a passing file tells nobody anything, and is another one every time.
            return Answers(engine, refused=str(error).replace(str(path), path.name))


def _answers(engine: str, robot: LoadedRobot, truth: Truth, describe: bool) -> Answers:
    states = truth.states
    deviation: dict[str, dict[str, Floats]] = {}
    failed: dict[str, str] = {}

    def ask(quantity: str, question: Callable[[], dict[str, Floats]]) -> None:
        try:
            deviation[quantity] = question()
        except DynxError as error:
            failed[quantity] = str(error)

    ask(KINEMATICS, lambda: _pose_deviation(robot, truth))
    if truth.model.nv:
        ask(JACOBIAN, lambda: _jacobian_deviation(robot, truth))
        ask(MASS, lambda: {"": _each(robot.mass_matrix, states.q) - truth.mass_matrix})
        ask(TORQUE, lambda: {"": _each(robot.inverse_dynamics, states.q, states.v, states.a) - truth.torque})
        if truth.solvable:
            ask(ACCELERATION, lambda: {"": _acceleration_deviation(robot, truth)})
    description = robot.describe() if describe else None
    return Answers(engine, None, deviation, failed, description)


def _each(question: Callable[..., Floats], *columns: Floats) -> Floats:
    return np.stack([question(*sample) for sample in zip(*columns, strict=True)])


def _pose_deviation(robot: LoadedRobot, truth: Truth) -> dict[str, Floats]:
    gap = _each(robot.link_poses, truth.states.q) - truth.poses
    names = [link.name for link in truth.model.links]
    # A link that the engine does not have is all NaN; one that it cannot place is so in part.
    return {name: gap[:, k] for k, name in enumerate(names) if not np.isnan(gap[:, k]).all()}


def _jacobian_deviation(robot: LoadedRobot, truth: Truth) -> dict[str, Floats]:
    gaps = {}
    for link, right in truth.jacobians.items():
        answers = _each(lambda q, link=link: robot.jacobian(q, link), truth.states.q)
        if not np.isnan(answers).all():
            gaps[link] = answers - right
    return gaps


def _acceleration_deviation(robot: LoadedRobot, truth: Truth) -> Floats:
    """For the torques of the states, and for those that accelerate the other way: a force that acts on
    one side alone, as that of a limit, shows in one of the two."""
    there = truth.states.tau
    back = 2.0 * truth.bias - there
    return np.stack([_backward_error(robot, truth, tau) for tau in (there, back)], axis=1)


def _backward_error(robot: LoadedRobot, truth: Truth, tau: Floats) -> Floats:
    states = truth.states
    found = _each(robot.forward_dynamics, states.q, states.v, tau)
    taken = truth.torque_taken(found)
    terms = np.einsum("nij,nj->ni", np.abs(truth.mass_matrix), np.abs(found))
    terms = terms + np.abs(truth.bias) + np.abs(tau)
    return np.asarray((taken - tau) / np.max(terms, axis=-1, initial=0.0, keepdims=True))


def change(before: Mapping[str, Floats], after: Mapping[str, Floats]) -> float:
    """Largest difference between two sets of deviations, where both have the same parts.

    Infinite where their shapes differ: the robots do not have the same coordinates.
    """
    gaps = [0.0]
    for part in before.keys() & after.keys():
        if before[part].shape != after[part].shape:
            return float("inf")
        gaps.append(_size(before[part] - after[part]))
    return max(gaps)


def coordinate_names(truth: Truth) -> tuple[str, ...]:
    """A name for each entry of v."""
    base = ("base x", "base y", "base z", "base roll", "base pitch", "base yaw")
    return (base if truth.model.floating else ()) + truth.model.joint_names


def _number(ratio: float) -> float:
    """The ratio, infinite where it is none: what is too large to be compared is no agreement."""
    return float("inf") if np.isnan(ratio) else ratio


def _largest(parts: Mapping[str, Floats]) -> float:
    return max((_size(part) for part in parts.values()), default=0.0)


def _size(array: Floats) -> float:
    size = np.abs(array)
    return float(np.max(np.where(np.isnan(size), np.inf, size), initial=0.0))
