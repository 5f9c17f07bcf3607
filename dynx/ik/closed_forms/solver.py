"""`ClosedForm`: all solutions of one arm, from the candidates of its branches, on a backend or alone.

A compiled closed form has the solutions of one pose in a few microseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import lru_cache
from itertools import combinations
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.base import Backend
from dynx.errors import ArgumentError, NoClosedFormError, ShapeError, shown
from dynx.ik.closed_forms.candidates import (
    ACCURACY,
    ARBITRARY,
    N_BRANCHES,
    POSITION,
    ROTATION,
    AxisFrames,
    Candidates,
    Mask,
    Review,
    branch_names,
    near_to,
)
from dynx.ik.closed_forms.chain import MAX_JOINTS, Chain, chain_to, checked_given
from dynx.ik.closed_forms.recognition import TOLERANCES, Recognised, recognise
from dynx.ik.closed_forms.solutions import FullTurns, IKSolutions
from dynx.ik.options import SearchLimits
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.elements import matrix_of_pair
from dynx.model.model import refuse_other_than_model
from dynx.model.numbers import checked_bool
from dynx.model.targets import checked_targets
from dynx.simd.variants import BoundVariants
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, pose_error

if TYPE_CHECKING:
    from dynx.ik.closed_forms.branch_kernel import BranchKernel


_NEARNESS = 1e-6, 100.0, 3.0
"""Error above which a candidate is not near a solution: at least, in units of the chain's tolerance, and in
units of the square root of its deviation, by which solutions near a singularity move."""

_EXACT = 2e-15
"""Deviation of a chain from the geometry that is rounding: its solutions need no polish."""

_SEPARATION = 1e-5, 10.0
"""Separation of two branches below which they may be one solution: at least, and in units of the square root
of the chain's deviation, by which solutions near a singularity move."""


MAX_SURPLUS = 3
"""Most joints beyond those of a closed form for which sets to be given are looked for."""


@checks_types
class ClosedForm:
    """The closed form of the inverse kinematics of one frame; safe to use from several threads."""

    def __init__(self, model: Model, chain: Chain, recognised: Recognised, *, compiled: bool) -> None:
        self.model = model
        """The robot."""
        self.joints = chain.joints
        """Names of the joints that are solved for, from the world to the frame."""
        self.given = dict(chain.given)
        """Positions [rad or m] of joints that are given."""
        self.family = recognised.description
        """Property of the axes that makes the closed form possible."""
        self.tolerance = recognised.tolerance
        """Tolerance [rad, or relative to the arm's length] to which the axes have that property."""
        self.branches = branch_names(recognised)
        """Names of the eight branches, in the order of the rows of a batch."""
        self._columns = list(chain.columns)
        self.full_turns = FullTurns.of(model, self._columns)
        """Angles that may take several values within their limits."""
        self.covers_model = self._columns == list(range(model.nq))
        """True if the model has no other joints."""
        self._length = chain.length
        self.accuracy = ACCURACY * max(1.0, chain.length)
        """Largest error [m, rad] of a solution."""
        least, of_tolerance, of_root = _NEARNESS
        root = recognised.deviation**0.5
        nearness = max(least, of_tolerance * recognised.tolerance, of_root * root)
        separation = max(_SEPARATION[0], _SEPARATION[1] * root)
        exact = recognised.deviation <= _EXACT
        self._candidates = Candidates(
            recognised.geometry,
            recognised.inverted,
            AxisFrames.of(chain),
            chain.T_zero[:3, :3],
            chain.T_zero[:3, 3],
            model.lower[self._columns],
            model.upper[self._columns],
            chain.revolute,
            chain.length,
            0 if exact else 1 + TOLERANCES.index(recognised.tolerance),
        )
        self._start = model.neutral()
        for name, value in chain.given.items():
            self._start[model.coordinate_index(name)] = value
        # Roots of a quartic that are not real may lead Newton's method to one that is.
        repeats = recognised.geometry.case.endswith("general")
        self._review = Review(self._candidates, nearness, separation, repeats)
        self.kernel: BranchKernel | None = None
        """The kernel that evaluates the branches, if the form is compiled."""
        if compiled:
            # Imported only here: every backend can solve in closed form, and LLVM is slow to import.
            from dynx.ik.closed_forms.branch_kernel import BranchKernel, Judgement

            fill = self._start[self._columns]
            self.kernel = BranchKernel(Judgement(self._candidates, self._length, nearness, separation, fill))
        joints = recognised.geometry.arbitrary
        self._arbitrary = [len(self.joints) - 1 - k for k in joints] if recognised.inverted else list(joints)

    def solve(
        self,
        target: ArrayLike,
        q0: ArrayLike | None = None,
        *,
        ignore_limits: bool = False,
        threads: int = 1,
    ) -> IKSolutions:
        """Return all solutions for poses T_world_target (..., 4, 4).

        Each solution has one value of each angle: the one within the limits that is nearest to 0, or to q0
        (..., nq) if that is given; `IKSolutions.with_full_turns` lists the others. Coordinates of
        other joints stay at q0, or at the neutral configuration. With `ignore_limits` solutions outside the
        limits are included. If the form is compiled, a batch is split over at most `threads` threads, with
        the same results for any number.

        Every solution reaches its pose within `review.ACCURACY`. Infinitely many configurations reach a
        singular pose, and one stands for them (`IKSolutions.arbitrary`). Its arbitrary angle is the angle
        nearest to 0 within the limits. For three parallel axes this angle may put the pose out of reach; then
        it is the nearest angle within reach. If the axes meet or are parallel only to `tolerance`, solutions
        may be missed within this distance of a singularity or of the edge of the workspace. If a quartic is
        solved, solutions may be missed within some 1e-6 rad of a singularity.

        Raises ShapeError, DTypeError, NotFiniteError or ArgumentError for an invalid target or q0.
        """
        ignore_limits = ignore_limits is not False and checked_bool("ignore_limits", ignore_limits)
        target = matrix_of_pair(target, "target")
        # A kernel finds targets that are no poses in a fraction of the time that NumPy takes.
        is_batch = (
            isinstance(target, np.ndarray)
            and target.dtype == np.float64
            and target.ndim >= 2
            and target.shape[-2:] == (4, 4)
        )
        T: Floats = np.asarray(target) if is_batch and self.kernel is not None else _checked_poses(target)
        batch = T.shape[:-2]
        start = self._start if q0 is None else checked_q(self.model, q0, "q0")
        if q0 is not None and not _fits(start.shape[:-1], batch):
            raise ShapeError(f"q0 has leading axes {start.shape[:-1]}; wanted those of target, {batch}")
        rows = np.ascontiguousarray(T).reshape(prod(batch), 4, 4)
        if self.kernel is None:
            reviewed = self._review(self._relative(rows), ignore_limits)
            angles, found = reviewed.angles, reviewed.found
            errors, arbitrary = self._errors(reviewed.measures), self._marked(reviewed.measures, found)
        else:
            results = self.kernel(rows, not ignore_limits, threads)
            if results.invalid.any():
                rows = _checked_poses(target).reshape(-1, 4, 4)
                results = self.kernel(rows, not ignore_limits, threads)
            angles, errors, arbitrary = results.q, results.errors, None
            found = np.unpackbits(results.found[:, None], axis=1, bitorder="little").view(np.bool_)
            doubtful = np.flatnonzero(results.review | results.invalid)
            if doubtful.size:
                reviewed = self._review(self._relative(rows[doubtful]), ignore_limits)
                kept = reviewed.found[..., None]
                angles[doubtful] = np.where(kept, reviewed.angles, self._start[self._columns])
                errors[doubtful], found[doubtful] = self._errors(reviewed.measures), reviewed.found
                marked = self._marked(reviewed.measures, reviewed.found)
                if marked is not None:
                    arbitrary = np.zeros((*found.shape, self.model.nq), dtype=np.bool_)
                    arbitrary[doubtful] = marked
        if q0 is not None:
            start = np.broadcast_to(start, (*batch, self.model.nq)).reshape(-1, 1, self.model.nq)
            limits = (self._candidates.lower, self._candidates.upper)
            angles = near_to(
                angles,
                start[..., self._columns],
                None if ignore_limits else limits,
                self._candidates.revolute,
            )
        if q0 is not None or self.kernel is None:
            angles = np.where(found[..., None], angles, start[..., self._columns])
        return self._solutions(batch, angles, errors, found, arbitrary, start)

    def _solutions(
        self,
        batch: tuple[int, ...],
        angles: Floats,
        errors: Floats,
        found: Mask,
        arbitrary: Mask | None,
        start: Floats,
    ) -> IKSolutions:
        nq = self.model.nq
        if self.covers_model:
            q = angles
        else:
            q = np.empty((*found.shape, nq))
            q[...] = start
            q[..., self._columns] = angles
        if not batch:
            bits = int(np.packbits(found[0], bitorder="little")[0])
            marked = None if arbitrary is None else arbitrary[found]
            return IKSolutions(
                q[found], errors[found], self.branches, bits, arbitrary=marked, full_turns=self.full_turns
            )
        shape = (*batch, N_BRANCHES)
        return IKSolutions(
            q.reshape(*shape, nq),
            errors.reshape(*shape, 2),
            self.branches,
            success=found.reshape(shape),
            arbitrary=None if arbitrary is None else arbitrary.reshape(*shape, nq),
            full_turns=self.full_turns,
        )

    def _relative(self, T: Floats) -> Floats:
        """Return poses (n, 3, 4) with lengths relative to that of the chain."""
        pose = T[:, :3].copy()
        pose[:, :, 3] /= self._length
        return np.asarray(pose)

    def _errors(self, measures: Floats) -> Floats:
        """Return the errors (n, 8, 2) of position [m] and rotation [rad]."""
        return np.asarray(measures[..., [POSITION, ROTATION]] * (self._length, 1.0))

    def _marked(self, measures: Floats, found: Mask) -> Mask | None:
        """Return which coordinates (n, 8, nq) of solutions are arbitrary, or None if none is."""
        code = np.where(found, measures[..., ARBITRARY], 0.0).astype(np.int64)
        if not code.any():
            return None
        arbitrary = np.zeros((*found.shape, self.model.nq), dtype=np.bool_)
        for place, joint in enumerate(self._arbitrary):
            arbitrary[..., self._columns[joint]] = (code >> place) & 1 == 1
        return arbitrary

    def __repr__(self) -> str:
        given = "".join(f", {name} given" for name in self.given)
        return f"<ClosedForm of {self.model.name}: {self.family}{given}>"


def _fits(shape: tuple[int, ...], batch: tuple[int, ...]) -> bool:
    """Return whether leading axes broadcast to those of a batch."""
    try:
        return np.broadcast_shapes(shape, batch) == batch
    except ValueError:
        return False


def _checked_poses(target: ArrayLike) -> Floats:
    """Return poses (..., 4, 4) as contiguous arrays; the errors of `checked_targets`, or ShapeError."""
    targets = checked_targets(target)
    if targets.positions is None or targets.rotations is None:
        raise ShapeError(
            f"target has shape {np.shape(target)}, a position; the closed form needs poses (..., 4, 4)"
        )
    return np.asarray(homogeneous(targets.rotations, targets.positions))


def closed_form(
    model: Model, frame: str, given: Mapping[str, float] | None = None, *, compiled: bool = False
) -> ClosedForm:
    """Return the closed form of the inverse kinematics of a frame.

    It exists for six revolute joints between world and frame if the last (or the first) three axes meet in a
    point, or if three successive axes are parallel. It also exists for a spherical wrist on an arm with
    prismatic joints, for three prismatic and up to three revolute joints, and for SCARA arms. `given` holds
    the positions [rad or m] of further joints between world and frame, such as one of seven.

    With `compiled` it is compiled for this arm, which takes some seconds unless it is in the cache.

    Raises NoClosedFormError, which says what is missing; UnknownNameError or ArgumentError for arguments.
    """
    refuse_other_than_model(model)
    model.frame_index(frame)
    positions = {} if given is None else given
    try:
        chain, recognised = _recognised(model, frame, positions)
    except NoClosedFormError as error:
        sets = _sets_to_give(error, model, frame, positions)
        raise NoClosedFormError(error.reason, _remedies(model, frame, positions, sets)) from None
    return ClosedForm(model, chain, recognised, compiled=compiled)


def _recognised(model: Model, frame: str, given: Mapping[str, float]) -> tuple[Chain, Recognised]:
    """Return the chain to a frame and its geometry. Raises NoClosedFormError."""
    chain = chain_to(model, frame, given)
    count = len(chain.joints)
    low, high = (each[list(chain.columns)] for each in (model.lower, model.upper))
    try:
        if count in range(1, MAX_JOINTS + 1):
            return chain, recognise(chain, np.clip(0.0, low, high))
    except NoClosedFormError:
        if count == MAX_JOINTS or not all(chain.revolute):
            raise
    raise NoClosedFormError(
        f"{count} joints move {shown(frame)} of {model.name}; the closed form is for {MAX_JOINTS}"
    )


@lru_cache(maxsize=64)
def stored_closed_form(
    model: Model, frame: str, given: tuple[tuple[str, float], ...], compiled: bool
) -> ClosedForm:
    """Return `closed_form`, the same object for equal arguments."""
    return closed_form(model, frame, dict(given), compiled=compiled)


def redundant_joints(model: Model, frame: str, given: Mapping[str, float] | None = None) -> tuple[str, ...]:
    """Return the joints between world and frame, of which any one that is given leaves a closed form."""
    joints = chain_to(model, frame, {} if given is None else given).joints
    found = _remedies(model, frame, {} if given is None else given, [(joint,) for joint in joints])
    return tuple(joint for (joint,) in found)


def _remedies(
    model: Model, frame: str, given: Mapping[str, float], sets: Iterable[tuple[str, ...]]
) -> list[tuple[str, ...]]:
    """Return those sets of joints that leave a closed form if they are given."""
    found = []
    for joints in sets:
        try:
            # At positions without special geometry.
            positions = {joint: 0.7 - 0.4 * k for k, joint in enumerate(joints)}
            _recognised(model, frame, {**given, **positions})
        except NoClosedFormError:
            continue
        found.append(joints)
    return found


def _sets_to_give(
    error: NoClosedFormError, model: Model, frame: str, given: Mapping[str, float]
) -> list[tuple[str, ...]]:
    """Return sets of joints that may leave a closed form if they are given."""
    if error.remedies:
        return list(error.remedies)
    try:
        joints = chain_to(model, frame, given).joints
    except NoClosedFormError:
        return []
    surplus = len(joints) - MAX_JOINTS
    return list(combinations(joints, surplus)) if 1 <= surplus <= MAX_SURPLUS else []


def all_solutions(
    backend: Backend,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None,
    given: Mapping[str, float] | None,
    position_tolerance: float,
    rotation_tolerance: float,
) -> IKSolutions:
    """Return the solutions of `ClosedForm.solve` that are within the tolerances [m], [rad] by the forward
    kinematics of the backend.

    A backend that compiles (attribute ``compiles``) uses the compiled form, whose kernel measures the
    solutions, unless joints are given: each position of theirs would be compiled anew.
    """
    compiled = backend.compiles and not given
    positions = () if given is None else _within_limits(backend.model, given)
    form = stored_closed_form(backend.model, frame, positions, compiled)
    target = matrix_of_pair(target, "target")
    found = form.solve(target, q0, threads=backend.threads)
    if compiled and min(position_tolerance, rotation_tolerance) >= form.accuracy:
        return found
    errors, rows = np.stack([found.position_error, found.rotation_error], axis=-1), found.success
    if not compiled:
        wanted = np.broadcast_to(np.asarray(target, dtype=np.float64)[..., None, :, :], (*rows.shape, 4, 4))
        parts = pose_error(wanted[rows], backend.forward_kinematics(found.q[rows], frame))
        errors[rows] = np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)
    within = (errors <= (position_tolerance, rotation_tolerance)).all(axis=-1)
    return found.measured(errors, rows & within)


def _within_limits(model: Model, given: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return the positions by joint; raise ArgumentError for one outside the limits: no solution has it."""
    checked = tuple(checked_given(model, given).items())
    for name, value in checked:
        at = model.coordinate_index(name)
        low, high = float(model.lower[at]), float(model.upper[at])
        if not low <= value <= high:
            unit = "m" if model.joint(name).type == "prismatic" else "rad"
            raise ArgumentError(
                f"the given position of joint {shown(name)} is {value:.6g} {unit}, outside its limits: "
                f"{low:.6g} to {high:.6g} {unit}"
            )
    return checked


_FLOAT64 = np.dtype(np.float64)

_ALL = 2**N_BRANCHES - 1

_Workspace = tuple[Callable[[], None], memoryview, Floats, Floats, BoundVariants]
"""Function that evaluates the pose, its masks, the pose (4, 4), and the block (8, n + 2) of results; last
what holds their memory."""

_ROWS = [np.flatnonzero([bits >> k & 1 for k in range(N_BRANCHES)]) for bits in range(2**N_BRANCHES)]
"""Numbers of the branches whose bits are set, for every byte."""


class SinglePose:
    """Function from one pose to its solutions, for an arm whose joints are those of the model.

    Safe to use from several threads.
    """

    def __init__(self, form: ClosedForm) -> None:
        assert form.kernel is not None
        self._kernel, self._names = form.kernel, form.branches
        self._turns, self._count = form.full_turns, len(form.joints)
        # Workspaces that no call uses at the moment.
        self._free: list[_Workspace] = [self._workspace()]

    def __call__(self, target: Any, q0: Any = None) -> IKSolutions | None:
        """Return the solutions for a pose (4, 4) without q0, or None for q0, and if the pose is not valid or
        needs a review."""
        if (
            q0 is not None
            or type(target) is not np.ndarray
            or target.dtype is not _FLOAT64
            or target.shape != (4, 4)
        ):
            return None
        try:
            workspace = self._free.pop()
        except IndexError:
            workspace = self._workspace()
        run, masks, pose, block, _ = workspace
        pose[...] = target
        run()
        bits = masks[0]
        # The bits of solutions are the first byte; others are set where there is something to review.
        rows = None if bits > _ALL else block.copy() if bits == _ALL else block.take(_ROWS[bits], 0)
        self._free.append(workspace)
        if rows is None:
            return None
        count = self._count
        return IKSolutions(rows[:, :count], rows[:, count:], self._names, bits, full_turns=self._turns)

    def _workspace(self) -> _Workspace:
        block = np.empty((N_BRANCHES, self._count + 2))
        bound = self._kernel.bind(block)
        return bound.run, bound.masks, bound.inputs[0].reshape(4, 4), block, bound


def single_pose_call(model: Model, frame: str, limits: SearchLimits) -> SinglePose | None:
    """Return the call for poses of a frame, or None if its solutions are to be checked or completed."""
    form = stored_closed_form(model, frame, (), True)
    tolerance = min(limits.position_tolerance, limits.rotation_tolerance)
    return SinglePose(form) if form.covers_model and tolerance >= form.accuracy else None
