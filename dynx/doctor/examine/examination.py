"""Examination of one file in several engines: their quantities, and the errors against reference values."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from dynx.doctor.examine.engine_input import temporary_urdf, without_meshes
from dynx.doctor.examine.reference_values import (
    ReferenceValues,
    draw_states,
    model_without_mimics,
    reference_values,
    with_positions,
)
from dynx.engines.silence import silence
from dynx.errors import DynxError, UnusableEngineError
from dynx.loaded import LoadedModel, LoadedRobot, loader_class
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.rules.case import Case
from dynx.rules.inertia import has_inertial_data
from dynx.spatial.scalar import Floats

KINEMATICS, JACOBIAN = "forward_kinematics", "jacobian"
MASS, TORQUE, ACCELERATION = "mass_matrix", "inverse_dynamics", "forward_dynamics"
LOADING = "loading"
"""Quantity in an effect on an engine that refuses the file."""

RESULT = "result"
"""Quantity in an effect on an engine that refuses nothing, but whose results on the file are not used."""

QUANTITIES = (KINEMATICS, JACOBIAN, MASS, TORQUE, ACCELERATION)
"""Compared quantities. Forward dynamics is compared by the torque that the computed acceleration requires."""


@dataclass(frozen=True, eq=False)
class EngineOutput:
    """Deviations of one engine from the reference values of one file.

    `deviation` maps a quantity to engine minus reference: by link (n, 4, 4) or (n, 6, nv) for poses and
    Jacobians, under "" (n, nv, nv) or (n, nv) for the rest, (n, 2, nv) for accelerations. A quantity that
    the engine could not compute is in `failed`, with its error message; `refused` is the message with which
    it refused the file, `not_used` the reason why dynx does not use the engine on it.
    """

    engine: str
    refused: str | None = None
    not_used: str | None = None
    deviation: Mapping[str, Mapping[str, Floats]] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)
    description: LoadedModel | None = None

    @property
    def no_results(self) -> str | None:
        """Reason why there are no results; None where there are some."""
        return self.not_used if self.refused is None else self.refused

    @property
    def missing(self) -> str:
        """The quantity in which an engine without results shows: `LOADING` or `RESULT`."""
        return RESULT if self.refused is None else LOADING

    def first(self, count: int) -> EngineOutput:
        """Keep the first `count` states."""
        deviation = {
            quantity: {part: gap[:count] for part, gap in parts.items()}
            for quantity, parts in self.deviation.items()
        }
        return replace(self, deviation=deviation)


@dataclass(frozen=True, eq=False)
class Examination:
    """Outputs of all engines for one case, and the reference values of the case's own text."""

    reference: ReferenceValues
    outputs: Mapping[str, EngineOutput]

    def first(self, count: int) -> Examination:
        """Keep the first `count` states."""
        return Examination(
            self.reference.first(count), {name: each.first(count) for name, each in self.outputs.items()}
        )

    def scale(self, quantity: str, engine: str) -> float:
        """Return the divisor of a deviation: the largest reference value, or the engine's largest value if
        that is 0.

        For a backward error, which is already relative, it is 1.
        """
        if quantity == ACCELERATION:
            return 1.0
        reference = self.reference
        expected = {
            KINEMATICS: reference.poses,
            JACOBIAN: np.stack(list(reference.jacobians.values())) if reference.jacobians else np.zeros(1),
            MASS: reference.mass_matrix,
            TORQUE: reference.torque,
        }[quantity]
        largest = float(np.max(np.abs(expected), initial=0.0))
        if largest > 0.0:
            return largest
        return _largest(self.outputs[engine].deviation.get(quantity, {})) or 1.0

    def error(self, engine: str, quantity: str) -> float:
        """Return the largest deviation over its scale; infinite where the engine computed nothing."""
        output = self.outputs[engine]
        if output.no_results is not None or quantity in output.failed:
            return float("inf")
        return _number(_largest(output.deviation.get(quantity, {})) / self.scale(quantity, engine))

    def errors(self, engine: str) -> dict[str, float]:
        """Return `error` of every quantity that was examined; empty where the file was refused."""
        output = self.outputs[engine]
        if output.no_results is not None:
            return {}
        examined = [quantity for quantity in QUANTITIES if quantity in {*output.deviation, *output.failed}]
        return {quantity: self.error(engine, quantity) for quantity in examined}

    def max_error(self, engine: str) -> float:
        """Return the largest of `errors`, infinite where the file was refused."""
        if self.outputs[engine].no_results is not None:
            return float("inf")
        return max(self.errors(engine).values(), default=0.0)

    def joint_errors(self, engine: str, other: str | None = None) -> dict[str, float]:
        """Return the errors of inverse dynamics joint by joint, against the reference or another engine,
        relative to the joint's largest reference torque (at least 1e-9 of the largest torque of all
        joints)."""
        mine = self.outputs[engine].deviation.get(TORQUE, {}).get("")
        theirs = None if other is None else self.outputs[other].deviation.get(TORQUE, {}).get("")
        if mine is None or (other is not None and theirs is None):
            return {}
        gap = np.max(np.abs(mine if theirs is None else mine - theirs), axis=0, initial=0.0)
        right = np.max(np.abs(self.reference.torque), axis=0, initial=0.0)
        size = np.maximum(right, 1e-9 * np.max(right, initial=0.0))
        ratio = np.where(gap > 0.0, gap / np.where(size > 0.0, size, 1.0), 0.0)
        return dict(zip(coordinate_names(self.reference), ratio.tolist(), strict=True))

    def pair_error(self, engine: str, other: str, quantity: str) -> float:
        """Return the deviation of two engines from each other, relative to its scale; infinite where one
        computed nothing."""
        one, two = self.outputs[engine], self.outputs[other]
        if quantity in {*one.failed, *two.failed} or one.no_results or two.no_results:
            return float("inf")
        gap = max_change(one.deviation.get(quantity, {}), two.deviation.get(quantity, {}))
        return _number(gap / self.scale(quantity, engine))


class Examiner:
    """Examiner of cases of one robot, with the same engines or variants, number of states and seed."""

    def __init__(
        self,
        engines: Collection[str],
        samples: int,
        seed: int,
        positions: Mapping[str, float] | None = None,
    ) -> None:
        """`seed` selects the random states; `positions` of the joints, by name, are one more state."""
        self.engines = {name: loader_class(name) for name in engines}
        self._samples = samples
        self.seed = seed
        self._positions = positions
        # One remedy after another leaves the robot as it is.
        self._values = lru_cache(maxsize=8)(self._compute_reference)

    def with_samples(self, samples: int) -> Examiner:
        """Return an examiner with the same engines and seed, and another number of states."""
        return Examiner(self.engines, samples, self.seed, self._positions)

    def at(self, positions: Mapping[str, float]) -> Examiner:
        """Return an examiner that examines the same states, and one with the joints at these positions."""
        return Examiner(self.engines, self._samples, self.seed, positions)

    def reference(self, case: Case) -> ReferenceValues:
        """Compute the reference values of a case at random states."""
        return self._values(without_meshes(case.source).text, case.source.source, case.base)

    def _compute_reference(self, text: str, name: str, base: Base) -> ReferenceValues:
        source = XmlSource(text, name)
        model = model_without_mimics(source, base)
        states = draw_states(model, self._samples, self.seed)
        if self._positions is not None:
            states = with_positions(model, states, self._positions)
        values = reference_values(model, states)
        return replace(values, kinematics_only=not has_inertial_data(Case(source, base)))

    def examine(
        self,
        case: Case,
        engines: Collection[str] | None = None,
        *,
        reference: ReferenceValues | None = None,
        describe: bool = False,
    ) -> Examination:
        """Load the text of the case in the engines and compute their errors; a given `reference` is not
        computed again."""
        reference = reference or self.reference(case)
        chosen = [name for name in self.engines if engines is None or name in engines]
        with ExitStack() as files:
            paths = {
                meshes: files.enter_context(temporary_urdf(text, mesh_boxes=meshes))
                for meshes, text in self._engine_inputs(case, chosen)
            }
            outputs = {
                name: self._evaluate(name, paths[self.engines[name].loads_meshes], case, reference, describe)
                for name in chosen
            }
        return Examination(reference, outputs)

    def without_unused(self, source: XmlSource) -> XmlSource:
        """Remove the shapes that none of the engines loads."""
        return without_meshes(source, collisions=not any(kind.loads_meshes for kind in self.engines.values()))

    def _engine_inputs(self, case: Case, chosen: Sequence[str]) -> Iterator[tuple[bool, XmlSource]]:
        """Yield the text for engines that load meshes (True) and for those that load none (False)."""
        for meshes in {self.engines[name].loads_meshes for name in chosen}:
            yield meshes, without_meshes(case.source, collisions=not meshes)

    def _evaluate(
        self, engine: str, path: Path, case: Case, reference: ReferenceValues, describe: bool
    ) -> EngineOutput:
        try:
            # Output of engines is suppressed; the report contains their messages in order.
            with (
                silence(),
                np.errstate(all="ignore"),
                self.engines[engine](path, reference.model, case.calls) as robot,
            ):
                return _outputs_of(engine, robot, reference, describe)
        except UnicodeDecodeError:
            # Raised by bindings that return names as text, for bytes of another encoding.
            return EngineOutput(engine, refused=f"{engine} cannot return names that are not in UTF-8")
        except DynxError as error:
            # The name of the temporary file differs each time, so it is removed from messages.
            reason = str(error).replace(str(path), path.name)
            if isinstance(error, UnusableEngineError):
                return EngineOutput(engine, not_used=reason)
            return EngineOutput(engine, refused=reason)


def _outputs_of(engine: str, robot: LoadedRobot, reference: ReferenceValues, describe: bool) -> EngineOutput:
    states = reference.states
    deviation: dict[str, dict[str, Floats]] = {}
    failed: dict[str, str] = {}

    def record(quantity: str, compute: Callable[[], dict[str, Floats]]) -> None:
        try:
            deviation[quantity] = compute()
        except DynxError as error:
            failed[quantity] = str(error)

    record(KINEMATICS, lambda: _pose_deviation(robot, reference))
    if reference.model.nv:
        record(JACOBIAN, lambda: _jacobian_deviation(robot, reference))
    if reference.model.nv and not reference.kinematics_only:
        record(MASS, lambda: {"": _evaluate_samples(robot.mass_matrix, states.q) - reference.mass_matrix})
        record(
            TORQUE,
            lambda: {
                "": _evaluate_samples(robot.inverse_dynamics, states.q, states.v, states.a) - reference.torque
            },
        )
        if reference.solvable:
            record(ACCELERATION, lambda: {"": _acceleration_deviation(robot, reference)})
    description = robot.describe() if describe else None
    return EngineOutput(engine, deviation=deviation, failed=failed, description=description)


def _evaluate_samples(compute: Callable[..., Floats], *columns: Floats) -> Floats:
    return np.stack([compute(*sample) for sample in zip(*columns, strict=True)])


def _pose_deviation(robot: LoadedRobot, reference: ReferenceValues) -> dict[str, Floats]:
    gap = _evaluate_samples(robot.link_poses, reference.states.q) - reference.poses
    names = [link.name for link in reference.model.links]
    # Poses of a link that the engine does not have are all NaN; one pose is NaN where it cannot be computed.
    return {name: gap[:, k] for k, name in enumerate(names) if not np.isnan(gap[:, k]).all()}


def _jacobian_deviation(robot: LoadedRobot, reference: ReferenceValues) -> dict[str, Floats]:
    gaps = {}
    for link, expected in reference.jacobians.items():
        found = _evaluate_samples(lambda q, link=link: robot.jacobian(q, link), reference.states.q)
        if not np.isnan(found).all():
            gaps[link] = found - expected
    return gaps


def _acceleration_deviation(robot: LoadedRobot, reference: ReferenceValues) -> Floats:
    """Return the backward errors for the torques of the states, and for torques that accelerate in the
    opposite direction.

    A force that acts on one side only, such as that of a joint limit, shows in one of the two.
    """
    forward = reference.states.tau
    opposite = 2.0 * reference.bias - forward
    return np.stack([_backward_error(robot, reference, tau) for tau in (forward, opposite)], axis=1)


def _backward_error(robot: LoadedRobot, reference: ReferenceValues, tau: Floats) -> Floats:
    states = reference.states
    found = _evaluate_samples(robot.forward_dynamics, states.q, states.v, tau)
    required = reference.required_torque(found)
    terms = np.einsum("nij,nj->ni", np.abs(reference.mass_matrix), np.abs(found))
    terms = terms + np.abs(reference.bias) + np.abs(tau)
    return np.asarray((required - tau) / np.max(terms, axis=-1, initial=0.0, keepdims=True))


def max_change(before: Mapping[str, Floats], after: Mapping[str, Floats]) -> float:
    """Return the largest difference between two sets of deviations, where both have the same parts.

    Infinite where their shapes differ, because the robots then have different coordinates.
    """
    gaps = [0.0]
    for part in before.keys() & after.keys():
        if before[part].shape != after[part].shape:
            return float("inf")
        gaps.append(_size(before[part] - after[part]))
    return max(gaps)


def coordinate_names(reference: ReferenceValues) -> tuple[str, ...]:
    """Return the names of the entries of v."""
    base = ("base x", "base y", "base z", "base roll", "base pitch", "base yaw")
    return (base if reference.model.floating else ()) + reference.model.joint_names


def _number(ratio: float) -> float:
    """Return the ratio, or infinity for NaN, because values too large to be compared do not agree."""
    return float("inf") if np.isnan(ratio) else ratio


def _largest(parts: Mapping[str, Floats]) -> float:
    return max((_size(part) for part in parts.values()), default=0.0)


def _size(array: Floats) -> float:
    size = np.abs(array)
    return float(np.max(np.where(np.isnan(size), np.inf, size), initial=0.0))
