"""Evaluation of an engine's hook at samples with any leading axes, reduced by mimic joints.

Mimic joints are a linear map v_tree = S v (`dynx.model.mechanism.Coupling`). By virtual work, torques are
mapped back by S', Jacobians and matrices by S. So every engine gives the reduced dynamics, although its own
model has all moving joints and no mimic joints.
"""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.hooks import solution_or_nan
from dynx.errors import ShapeError
from dynx.model import Mechanism
from dynx.spatial.scalar import Floats

MIN_SUMMED_COLUMNS = 256
"""Number of columns from which on rows of one sample are added one by one, as in batches: S has one entry in
each of its rows, so that a product with S takes several times as long."""


class Reduction(NamedTuple):
    """Functions that reduce a result in tree coordinates: of one sample, and with any leading axes.

    Rows and columns of batches are added one by one, in an order that does not depend on the batch.
    """

    of_sample: Callable[[Floats], Floats]
    of_batch: Callable[[Floats], Floats]


class HookEvaluation:
    """Evaluator of an engine's hooks on batches of samples of one model."""

    def __init__(self, mechanism: Mechanism, *, vectorized: bool) -> None:
        self._vectorized = vectorized
        self._coupling = mechanism.coupling
        self._S: Floats = np.eye(0) if self._coupling is None else self._coupling.matrix()
        self._S_T: Floats = np.ascontiguousarray(self._S.T)
        # The row of each coordinate's own joint, where S is 1, and the rows of the joints that follow it.
        own = (self._S == 1.0).argmax(axis=0) if self._S.size else np.zeros(0, dtype=np.intp)
        self._own_rows = own
        self._followers = [
            (row, column, float(self._S[row, column]))
            for row, column in np.argwhere(self._S).tolist()
            if row != own[column]
        ]

    def __call__(
        self,
        hook: Callable[..., Any],
        result_shape: tuple[int, ...],
        q: Floats,
        *velocities: Floats,
        args: tuple[Any, ...] = (),
        reduce: Reduction | None = None,
    ) -> Floats:
        """Evaluate `hook(q, *velocities, *args)` for every sample of the broadcast batch.

        q (..., nq) and velocities (..., nv) are in model coordinates, the hook's in tree
        coordinates. `result_shape` is the shape of one result in tree coordinates; `reduce` converts it.
        """
        batch = common_batch(q, *velocities)
        if self._coupling is not None:
            q = self._coupling.expand_q(q)
            velocities = tuple(v @ self._S_T for v in velocities)
        samples = [
            x if x.shape[:-1] == batch else np.broadcast_to(x, (*batch, x.shape[-1]))
            for x in (q, *velocities)
        ]
        shape = (*batch, *result_shape)
        if self._vectorized or not batch:
            result = np.asarray(hook(*samples, *args))
            if result.shape != shape:
                # A result that depends on no coordinate may lack the batch axes.
                result = np.array(np.broadcast_to(result, shape))
        else:
            result = self._one_by_one(hook, shape, samples, args)
        if self._coupling is not None and reduce is not None:
            # As in `of_sample`, so that the calls of one sample do not differ by rounding.
            return reduce.of_batch(result) if batch else reduce.of_sample(result)
        return result

    def of_sample(self, function: Callable[..., Any], reduce: Reduction | None) -> Callable[..., Any]:
        """Return the function of a backend, q and velocities in model coordinates that evaluates `function`,
        which is that of a hook, at one sample.

        Mimic joints are expanded by products, which takes half of the time of gathering and scaling, and is
        exact as well, because each row of S has one entry.
        """
        if self._coupling is None:
            return function
        expand_q, S = self._expansion_of_sample(), self._S
        reduce_sample = None if reduce is None else reduce.of_sample

        def reduced(backend: object, q: Floats, *velocities: Floats) -> Any:
            result = function(backend, expand_q(q), *[S.dot(v) for v in velocities])
            return result if reduce_sample is None else reduce_sample(np.asarray(result))

        return reduced

    def solution_of_sample(
        self, mass_matrix: Callable[..., Any], bias_torque: Callable[..., Any]
    ) -> Callable[..., Floats]:
        """Return the function of a backend, q, v and tau in model coordinates that solves for the
        acceleration of one sample, given the functions of two hooks; NaN where it is not unique."""
        if self._coupling is None:
            return lambda backend, q, v, tau: solution_or_nan(
                np.asarray(mass_matrix(backend, q)), tau - bias_torque(backend, q, v)
            )
        expand_q, S, S_T = self._expansion_of_sample(), self._S, self._S_T

        def solved(backend: object, q: Floats, v: Floats, tau: Floats) -> Floats:
            q, v = expand_q(q), S.dot(v)
            M = S_T.dot(mass_matrix(backend, q)).dot(S)
            return solution_or_nan(M, tau - bias_torque(backend, q, v).dot(S))

        return solved

    def _expansion_of_sample(self) -> Callable[[Floats], Floats]:
        """Return the map from the configuration of one sample to that of the tree."""
        assert self._coupling is not None
        A, b = self._coupling.affine_map()
        return (lambda q: A.dot(q) + b) if b.any() else A.dot

    def reduction(self, *, rows: bool, columns: bool) -> Reduction | None:
        """Return the reduction of the rows of a result, S' A, of its columns, A S, or of both; None for
        neither."""
        S, S_T = self._S, self._S_T
        if rows and columns:
            # For small arrays `dot` takes a third of the time of `matmul`.
            return Reduction(
                lambda A: np.asarray(S_T.dot(A.dot(S))), lambda A: self.reduce_columns(self.reduce_rows(A))
            )
        if columns:
            return Reduction(lambda A: np.asarray(A.dot(S)), self.reduce_columns)
        if rows:
            return Reduction(
                lambda A: self.reduce_rows(A) if A.shape[1] >= MIN_SUMMED_COLUMNS else np.asarray(S_T.dot(A)),
                self.reduce_rows,
            )
        return None

    def reduce_columns(self, result: Floats) -> Floats:
        """Return A S for a torque (..., nv), a Jacobian (..., 6, nv) or a matrix."""
        reduced = result.take(self._own_rows, axis=-1)
        for row, column, scale in self._followers:
            reduced[..., column] += scale * result[..., row]
        return reduced

    def reduce_rows(self, result: Floats) -> Floats:
        """Return S' A for a matrix (..., nv, n)."""
        reduced = result.take(self._own_rows, axis=-2)
        for row, column, scale in self._followers:
            reduced[..., column, :] += scale * result[..., row, :]
        return reduced

    def _one_by_one(
        self, hook: Callable[..., Any], shape: tuple[int, ...], samples: list[Floats], args: tuple[Any, ...]
    ) -> Floats:
        batch = samples[0].shape[:-1]
        flat = [batch_rows(np.ascontiguousarray(x), batch) for x in samples]
        result = np.empty((prod(batch), *shape[len(batch) :]))
        for k, sample in enumerate(zip(*flat, strict=True)):
            result[k] = hook(*sample, *args)
        return result.reshape(shape)


def common_batch(q: Floats, *others: Floats) -> tuple[int, ...]:
    """Return the leading axes to which the arguments broadcast. Raises ShapeError if they do not."""
    batch = q.shape[:-1]
    if all(other.shape[:-1] == batch for other in others):
        return batch
    try:
        return np.broadcast_shapes(batch, *(other.shape[:-1] for other in others))
    except ValueError:
        shapes = ", ".join(str(array.shape) for array in (q, *others))
        raise ShapeError(f"the leading axes of {shapes} do not broadcast") from None


def batch_rows(array: Floats, batch: tuple[int, ...]) -> Floats:
    """Return the rows (n, size) of an array (..., size) broadcast to a batch of n, if possible as a view."""
    if array.shape[:-1] == batch:
        return array.reshape(prod(batch), array.shape[-1])
    if array.ndim == 1:
        # A single sample is broadcast without a copy.
        return np.broadcast_to(array, (prod(batch), *array.shape))
    return np.broadcast_to(array, (*batch, array.shape[-1])).reshape(prod(batch), array.shape[-1])
