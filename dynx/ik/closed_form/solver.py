"""`ClosedForm`: all solutions of one arm, from the candidates of its branches.

A candidate is a solution if it reaches the pose and lies within the limits. Few need a second look: those
near a singularity, where Newton's method takes more steps and two branches may be one, and those at a limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from math import prod

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.errors import NoClosedFormError, ShapeError, shown
from dynx.ik.closed_form.branches import N_BRANCHES, branch_names
from dynx.ik.closed_form.candidates import (
    ARBITRARY,
    FULL_TURN,
    PIVOT,
    POSITION,
    ROTATION,
    VIOLATION,
    Candidates,
)
from dynx.ik.closed_form.chain import N_JOINTS, Chain, chain_to
from dynx.ik.closed_form.evaluation import Evaluation, NumpyEvaluation
from dynx.ik.closed_form.polish import AxisFrames
from dynx.ik.closed_form.recognition import TOLERANCES, Recognised, recognise
from dynx.ik.closed_form.solutions import IKSolutions
from dynx.ik.targets import checked_targets
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.model import refuse_other_than_model
from dynx.spatial.scalar import Floats

ACCURACY = 1e-11
"""Largest error of a solution: of the position relative to the length of the chain, and of the rotation
[rad]."""

_ROUNDING = 1e-13
"""Error above which a candidate is polished further."""

_NEARNESS = 1e-6, 100.0
"""Error above which a candidate is not near a solution: at least, and in units of the chain's tolerance."""

_SINGULAR_PIVOT = 1e-9
"""Pivot of J' J below which two candidates may be one solution."""

_SAME = 1e-6
"""Difference [rad] up to which two candidates are one solution. At a singularity rounding moves a solution by
the square root of its error."""

_AT_LIMIT = 1e-8
"""Violation [rad] of a limit that counts as rounding: the solution is moved to the limit if it still reaches
the pose."""

_FURTHER_STEPS = 20

Mask = NDArray[np.bool_]


class ClosedForm:
    """The closed form of the inverse kinematics of one frame; safe to use from several threads."""

    def __init__(self, model: Model, chain: Chain, recognised: Recognised, *, compiled: bool) -> None:
        self.model = model
        """The robot."""
        self.joints = chain.joints
        """Names of the six joints that are solved for."""
        self.given = dict(chain.given)
        """Positions [rad or m] of joints that are given."""
        self.family = recognised.description
        """Property of the axes that makes the closed form possible."""
        self.tolerance = recognised.tolerance
        """Tolerance [rad, or relative to the arm's length] to which the axes have that property."""
        self.branches = branch_names(recognised)
        """Names of the eight branches, in the order of the rows of a batch."""
        # Roots of a quartic that are not real may lead Newton's method to one that is.
        self._repeats = recognised.geometry.case == "general"
        self._columns = list(chain.columns)
        self._all_columns = self._columns == list(range(model.nq))
        self._length = chain.length
        self._nearness = max(_NEARNESS[0], _NEARNESS[1] * recognised.tolerance)
        steps = 1 + TOLERANCES.index(recognised.tolerance)
        self._candidates = Candidates(
            recognised.geometry,
            recognised.inverted,
            AxisFrames.of(chain),
            chain.T_zero[:3, :3],
            chain.T_zero[:3, 3],
            model.lower[self._columns],
            model.upper[self._columns],
            steps,
        )
        self._evaluation: Evaluation = NumpyEvaluation(self._candidates)
        if compiled:
            # Imported only here: every backend can solve in closed form, and LLVM is slow to import.
            from dynx.ik.closed_form.compiled_evaluation import CompiledEvaluation

            self._evaluation = CompiledEvaluation(self._candidates)
        self._start = model.neutral()
        for name, value in chain.given.items():
            self._start[model.coordinate_index(name)] = value
        joints = recognised.geometry.arbitrary
        self._arbitrary = [5 - k for k in joints] if recognised.inverted else list(joints)

    def solve(
        self, target: ArrayLike, q0: ArrayLike | None = None, *, ignore_limits: bool = False
    ) -> IKSolutions:
        """Return all solutions for poses T_world_target (..., 4, 4).

        Each solution has one value of each angle: the one within the limits that is nearest to 0, or to q0
        (..., nq) if that is given. Its other values that differ by full turns are not listed. Coordinates of
        other joints stay at q0, or at the neutral configuration. With `ignore_limits` solutions outside the
        limits are included.

        Every solution reaches its pose within `ACCURACY`. At a singular pose, where infinitely many
        configurations do, one stands for them (`IKSolutions.arbitrary`): its arbitrary angle is the one
        nearest to 0 within the limits, or for three parallel axes, if that puts the pose out of reach, the
        nearest within reach. Where the axes meet or are parallel only to `tolerance`, solutions may be missed
        that close to a singularity or to the edge of the workspace.

        Raises ShapeError, DTypeError, NotFiniteError or ArgumentError for an invalid target or q0.
        """
        targets = checked_targets(target)
        if targets.positions is None or targets.rotations is None:
            raise ShapeError("target is a position; the closed form needs poses (..., 4, 4)")
        batch = targets.batch
        n = prod(batch)
        pose = np.empty((n, 3, 4))
        pose[:, :, :3] = targets.rotations.reshape(n, 3, 3)
        pose[:, :, 3] = targets.positions.reshape(n, 3)
        pose[:, :, 3] /= self._length
        start = self._start if q0 is None else checked_q(self.model, q0, "q0")
        angles, measures = self._evaluation(pose)
        found = self._reviewed(pose, angles, measures, ignore_limits)
        if q0 is not None or start.ndim > 1:
            shape = np.broadcast_shapes(batch, start.shape[:-1])
            if shape != batch:
                raise ShapeError(f"q0 has leading axes {start.shape[:-1]}; wanted those of target, {batch}")
            start = np.broadcast_to(start, (*batch, self.model.nq)).reshape(n, 1, self.model.nq)
            self._move_near(angles, start[..., self._columns], ignore_limits)
        return self._solutions(batch, angles, measures, found, start)

    def _solutions(
        self, batch: tuple[int, ...], angles: Floats, measures: Floats, found: Mask, start: Floats
    ) -> IKSolutions:
        n, nq = len(angles), self.model.nq
        code = np.where(found, measures[..., ARBITRARY], 0.0)
        if not batch:
            rows = np.flatnonzero(found[0])
            measures, code, angles = measures[:, rows], code[:, rows], angles[:, rows]
            found = found[:, rows]
        if self._all_columns and not batch:
            q = angles
        elif self._all_columns:
            q = np.where(found[..., None], angles, start)
        else:
            q = np.empty((n, found.shape[1], nq))
            q[...] = start
            q[..., self._columns] = np.where(found[..., None], angles, q[..., self._columns])
        arbitrary = np.zeros((n, found.shape[1], nq), dtype=np.bool_)
        if code.any():
            for place, joint in enumerate(self._arbitrary):
                arbitrary[..., self._columns[joint]] = (code.astype(np.int64) >> place) & 1 == 1
        shape = (*batch, found.shape[1])
        zeros = np.zeros(shape, dtype=np.int64)
        names = self.branches if batch else tuple(self.branches[k] for k in rows)
        return IKSolutions(
            q.reshape(*shape, nq),
            found.reshape(shape),
            (measures[..., POSITION] * self._length).reshape(shape),
            measures[..., ROTATION].reshape(shape),
            zeros,
            zeros,
            names,
            arbitrary.reshape(*shape, nq),
        )

    def _reviewed(self, pose: Floats, angles: Floats, measures: Floats, ignore_limits: bool) -> Mask:
        """Return which candidates (n, 8) are distinct solutions; polish those that need it, in place."""
        error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
        rough = (error > _ROUNDING) & (error < self._nearness)
        if rough.any():
            self._polish(pose, angles, measures, error, rough)
        found: Mask = error <= ACCURACY
        if not ignore_limits:
            violation = measures[..., VIOLATION]
            at_limit = found & (violation > 0.0) & (violation <= _AT_LIMIT)
            if at_limit.any():
                self._move_to_limits(pose, angles, measures, at_limit)
                error = np.maximum(measures[..., POSITION], measures[..., ROTATION])
            found &= (measures[..., VIOLATION] <= 0.0) & (error <= ACCURACY)
        doubtful = found if self._repeats else found & (measures[..., PIVOT] < _SINGULAR_PIVOT)
        poses = np.flatnonzero(doubtful.sum(axis=1) > 1)
        if poses.size:
            found[poses] = _distinct(angles[poses], found[poses])
        return found

    def _polish(self, pose: Floats, angles: Floats, measures: Floats, error: Floats, rough: Mask) -> None:
        """Polish the candidates `rough` further, where that reduces their error."""
        rows = np.nonzero(rough)
        result = self._candidates.measured(pose[rows[0]], angles[rows], _FURTHER_STEPS)
        after = result["measures"]
        reached = np.maximum(after[..., POSITION], after[..., ROTATION])
        better = reached < error[rows]
        rows = tuple(each[better] for each in rows)
        after[..., ARBITRARY] = measures[rough][..., ARBITRARY]
        angles[rows], measures[rows], error[rows] = result["q"][better], after[better], reached[better]

    def _move_to_limits(self, pose: Floats, angles: Floats, measures: Floats, at_limit: Mask) -> None:
        rows = np.nonzero(at_limit)
        angles[rows] = np.clip(angles[rows], self._candidates.lower, self._candidates.upper)
        result = self._candidates.measured(pose[rows[0]], angles[rows], 0)
        measures[rows] = np.where(np.arange(measures.shape[-1]) < PIVOT, result["measures"], measures[rows])
        measures[rows[0], rows[1], VIOLATION] = 0.0

    def _move_near(self, angles: Floats, start: Floats, ignore_limits: bool) -> None:
        """Shift angles by full turns to be near `start`, within the limits if they are."""
        low, high = self._candidates.lower, self._candidates.upper
        near = start + np.remainder(angles - start + np.pi, FULL_TURN) - np.pi
        if not ignore_limits:
            near += FULL_TURN * (near < low - _AT_LIMIT)
            near -= FULL_TURN * (near > high + _AT_LIMIT)
            clipped = np.clip(near, low, high)
            near = np.where(np.abs(near - clipped) <= _AT_LIMIT, clipped, angles)
        angles[...] = near

    def __repr__(self) -> str:
        given = "".join(f", {name} given" for name in self.given)
        return f"<ClosedForm of {self.model.name}: {self.family}{given}>"


def _distinct(angles: Floats, found: Mask) -> Mask:
    """Return `found` (n, 8) without solutions that repeat an earlier one."""
    found = found.copy()
    for later in range(1, N_BRANCHES):
        for earlier in range(later):
            difference = angles[:, later] - angles[:, earlier]
            difference -= FULL_TURN * np.round(difference / FULL_TURN)
            same = np.abs(difference).max(axis=-1) < _SAME
            found[:, later] &= ~(same & found[:, earlier])
    return found


def closed_form(
    model: Model, frame: str, given: Mapping[str, float] | None = None, *, compiled: bool = False
) -> ClosedForm:
    """Return the closed form of the inverse kinematics of a frame.

    It exists for six revolute joints between world and frame of which the last (or the first) three axes meet
    in a point, or of which the axes 2, 3 and 4 (or 3, 4 and 5) are parallel. `given` holds the positions [rad
    or m] of further joints between world and frame, such as one of seven.

    With `compiled` it is compiled for this arm, which takes some seconds unless it is in the cache.

    Raises NoClosedFormError, which says what is missing; UnknownNameError or ArgumentError for arguments.
    """
    model.frame_index(frame)
    refuse_other_than_model(model)
    positions = {} if given is None else given
    chain = chain_to(model, frame, positions)
    if len(chain.joints) != N_JOINTS:
        raise NoClosedFormError(_wrong_count(model, frame, chain))
    low, high = (each[list(chain.columns)] for each in (model.lower, model.upper))
    return ClosedForm(model, chain, recognise(chain, np.clip(0.0, low, high)), compiled=compiled)


@lru_cache(maxsize=64)
def stored_closed_form(
    model: Model, frame: str, given: tuple[tuple[str, float], ...], compiled: bool
) -> ClosedForm:
    """Return `closed_form`, the same object for equal arguments."""
    return closed_form(model, frame, dict(given), compiled=compiled)


def redundant_joints(model: Model, frame: str, given: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """Return the joints between world and frame of which one, if it is given, leaves a closed form."""
    found = []
    positions = {} if given is None else dict(given)
    for joint in chain_to(model, frame, positions).joints:
        try:
            # At a position without special geometry.
            closed_form(model, frame, {**positions, joint: 0.7})
        except NoClosedFormError:
            continue
        found.append(joint)
    return tuple(found)


def _wrong_count(model: Model, frame: str, chain: Chain) -> str:
    count = len(chain.joints)
    text = f"{count} joints move {shown(frame)} of {model.name}; the closed form is for {N_JOINTS}"
    if count == N_JOINTS + 1:
        names = redundant_joints(model, frame, chain.given)
        if names:
            return f"{text} and a given one: given={{{names[0]!r}: ...}} (or {', '.join(names[1:])})"
        return f"{text}, and none of them leaves one if it is given"
    return text
