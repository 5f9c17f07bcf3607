"""Calls of routines for robots with mimic joints: expanded to tree coordinates, results reduced."""

from __future__ import annotations

from collections.abc import Callable
from math import prod
from typing import Any

import numpy as np

from dynx.backends.evaluation import HookEvaluation, batch_rows, common_batch
from dynx.backends.straight import straight_call
from dynx.compiled.call import ABSENT, Check, given_arguments, write_into
from dynx.compiled.kernels import kernel_quantity
from dynx.model import Mechanism, Model
from dynx.spatial.scalar import Floats

MIN_BLOCK, BLOCK_NUMBERS = 32, 2**16
"""Least number of samples, and of numbers in tree coordinates, of a block in which each thread evaluates a
batch: results of a larger one would leave the caches before they are reduced."""


class CoupledCall:
    """A quantity of a robot with mimic joints, evaluated in tree coordinates by a call without them, whose
    results have the shape `shape`."""

    def __init__(
        self,
        model: Model,
        mechanism: Mechanism,
        quantity: str,
        in_tree: Callable[..., Floats],
        checks: tuple[Check, ...],
        *,
        shape: tuple[int, ...],
        threads: int,
        validate: bool,
    ) -> None:
        described = kernel_quantity(quantity)
        self._evaluation = HookEvaluation(mechanism, vectorized=True)
        self._reduce = self._evaluation.reduction(
            rows=described.reduces_rows, columns=described.reduces_columns
        )
        self._in_tree, self._shape, self._checks = in_tree, shape, checks
        self._block = threads * max(MIN_BLOCK, BLOCK_NUMBERS // prod(shape))
        of_sample = self._evaluation.of_sample(lambda _, *sample: in_tree(*sample), self._reduce)
        self._straight = straight_call(model, of_sample, len(checks), validate=validate)

    def evaluate(self, q: Any, v: Any = ABSENT, a: Any = ABSENT, out: Floats | None = None) -> Floats:
        """Return the result (..., *shape), as `KernelCall.evaluate` does."""
        arguments = given_arguments(q, v, a)
        result: Floats | None = self._straight(None, arguments)
        if result is None:
            arrays = [check(argument) for check, argument in zip(self._checks, arguments, strict=True)]
            result = self._batch(arrays)
        return write_into(out, result)

    def _batch(self, arrays: list[Floats]) -> Floats:
        batch = common_batch(*arrays)
        n = prod(batch)
        if n < 2 * self._block:
            return self._evaluation(self._in_tree, self._shape, *arrays, reduce=self._reduce)
        rows = [batch_rows(array, batch) for array in arrays]
        blocks = [
            self._evaluation(
                self._in_tree,
                self._shape,
                *(array[first : first + self._block] for array in rows),
                reduce=self._reduce,
            )
            for first in range(0, n, self._block)
        ]
        result = np.concatenate(blocks)
        return result.reshape(*batch, *result.shape[1:])
