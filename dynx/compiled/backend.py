"""The backend `compiled`: `dynx.rbd` traced for one robot and compiled for this processor.

Every quantity is compiled into a kernel when it is first needed, with the robot's numbers as constants
(`dynx.compiled.kernels`; one kernel serves many frames, see `dynx.compiled.frames`). Batches are evaluated
several samples at a time and on several threads. Compiled kernels are kept in a cache (`dynx.simd.cache`).

Several threads may share one backend and its kernels.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property
from math import hypot
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dynx._version import __version__
from dynx.backends.arguments import Arguments
from dynx.backends.base import Backend
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.backends.quantity_calls import Forces, Key
from dynx.compiled.call import CoupledCall, KernelCall, NumericCall, write_into
from dynx.compiled.frames import chain_of, place_of
from dynx.compiled.kernels import (
    ON_CHAINS,
    chain_kernel,
    compiles,
    kernel_quantity,
    quantity_kernel,
    routines_evaluate,
)
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.table_kernels import table_kernel
from dynx.model import Model
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE, checked_bool
from dynx.rbd.elimination import has_physical_inertias
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.simd.image import COMPILE_LOCK
from dynx.simd.kernel import Kernel
from dynx.simd.target import compiler_version, host
from dynx.simd.threads import checked_threads
from dynx.spatial.scalar import Floats

Call = Callable[..., Floats]


class CompiledBackend(Backend):
    """Kernels of `dynx.rbd` behind the interface of `Backend`.

    A batch is split over at most `threads` threads; None stands for one per processor. Results are the same
    bit for bit for any number of threads.

    `forward_kinematics`, `jacobian`, `inverse_dynamics`, `forward_dynamics` and `mass_matrix` take `out`, a
    C-contiguous float64 array of the shape of the result, which they fill and return; its content after an
    error is undefined.
    """

    name: ClassVar[str] = "compiled"
    vectorized: ClassVar[bool] = True
    compiles: ClassVar[bool] = True
    takes_ball_joints: ClassVar[bool] = True

    _arguments: FastArguments

    def __init__(self, model: Model, *, threads: int | None = None, validate: bool = True) -> None:
        """Raises ArgumentError for an invalid number of threads."""
        super().__init__(model, validate=validate)
        self._options["threads"] = threads
        self._threads = checked_threads(threads)
        self._arguments = FastArguments(model)
        self._simplified = simplify_mechanism(self._mechanism)
        self._all_frames = tuple(range(len(self._frame_index)))
        self._calls: dict[object, KernelCall | NumericCall | CoupledCall] = {}
        self._chain_kernels: dict[object, Kernel] = {}
        # The same calls under the arguments of the public methods, which saves looking up names.
        self._public_calls: dict[object, Call] = {}

    @cached_property
    def _eliminates(self) -> bool:
        return has_physical_inertias(self._mechanism) and (
            self._uncoupled or compiles(self._simplified, "forward_dynamics")
        )

    @property
    def threads(self) -> int:
        """Most threads for a batch."""
        return self._threads

    @property
    def engine_version(self) -> str:
        """``dynx`` and its version, the compiler's, and the processor."""
        return f"dynx {__version__}, {compiler_version()}, {host().cpu}"

    def _release(self) -> None:
        super()._release()
        # Calls in progress on other threads keep a reference to their kernels until they return.
        with COMPILE_LOCK:
            self._public_calls, self._calls, self._chain_kernels = {}, {}, {}

    # -- with `out` ---------------------------------------------------------------------------

    def forward_kinematics(
        self, q: ArrayLike, frame: str | Sequence[str] | None = None, *, out: Floats | None = None
    ) -> Floats:
        if frame is not None and not isinstance(frame, str):
            names = self._arguments.frames(frame)
            # The poses are selected from those of all frames, because a kernel for each list of frames would
            # round differently.
            of_all = self._call_for("frame_placements", self._all_frames)
            return write_into(out, of_all(q)[..., [self._index(name) for name in names], :, :])
        call = self._public_calls.get(("forward_kinematics", frame))
        if call is None:
            self._arguments.refuse_closed()
            key = ("forward_kinematics", frame)
            if frame is None:
                call = self._store_call(key, "frame_placements", self._all_frames)
            else:
                call = self._store_call(key, "frame_placement", (self._index(frame),))
        return call(q, out=out)

    def jacobian(
        self,
        q: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
        out: Floats | None = None,
    ) -> Floats:
        if point is not None:
            return write_into(out, super().jacobian(q, frame, reference=reference, point=point))
        try:
            call = self._public_calls["jacobian", frame, reference]
        except (KeyError, TypeError):
            self._arguments.refuse_closed()
            axes = self._arguments.reference(reference)
            call = self._store_call(("jacobian", frame, reference), "jacobian", (self._index(frame), axes))
        return call(q, out=out)

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
        out: Floats | None = None,
    ) -> Floats:
        if external_forces is None and joint_dynamics is False:
            call = self._public_calls.get("inverse_dynamics")
            if call is None:
                call = self._call_by_name("inverse_dynamics")
            return call(q, v, a, out)
        tau = super().inverse_dynamics(
            q,
            v,
            a,
            external_forces=external_forces,
            force_reference=force_reference,
            joint_dynamics=joint_dynamics,
        )
        return write_into(out, tau)

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
        out: Floats | None = None,
    ) -> Floats:
        if external_forces is None and joint_dynamics is False and self._eliminates:
            call = self._public_calls.get("forward_dynamics")
            if call is None:
                self._arguments.refuse_closed()
                self._solvability.refuse_singular(joint_dynamics)
                call = self._call_by_name("forward_dynamics")
            return call(q, v, tau, out)
        a = super().forward_dynamics(
            q,
            v,
            tau,
            external_forces=external_forces,
            force_reference=force_reference,
            joint_dynamics=joint_dynamics,
        )
        return write_into(out, a)

    def mass_matrix(self, q: ArrayLike, *, joint_dynamics: bool = False, out: Floats | None = None) -> Floats:
        call = self._public_calls.get("mass_matrix")
        if call is None:
            call = self._call_by_name("mass_matrix")
        M = call(q, out=out)
        if joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics):
            M += self._joint_terms.armature
        return M

    # -- kernels ------------------------------------------------------------------------------

    def _evaluate(self, key: Key, arguments: tuple[Any, ...]) -> Floats:
        """Evaluate by a kernel in model coordinates, into which mimic joints are compiled.

        The call of the kernel checks the arguments.
        """
        try:
            call = self._public_calls[key]
        except (KeyError, TypeError):
            if key == "forward_dynamics" and not self._eliminates:
                return self._evaluate_samples(key, arguments)
            self._arguments.refuse_closed()
            name, *frame = (key,) if isinstance(key, str) else key
            details = self._frame_details(*frame) or QUANTITIES[name].implied_details(self.model)
            call = self._store_call(key, name, details)
        return call(*arguments)

    def _call_by_name(self, quantity: str) -> Call:
        """Return the call of a quantity without details, stored under its name."""
        self._arguments.refuse_closed()
        return self._store_call(quantity, quantity)

    def _store_call(self, key: object, quantity: str, details: tuple[Any, ...] = ()) -> Call:
        """Return the call of a quantity, stored under `key`."""
        call = self._call_for(quantity, details)
        with COMPILE_LOCK:
            self._arguments.refuse_closed()
            self._public_calls[key] = call
        return call

    def _unchecked_callable(self, quantity: str) -> Call | None:
        if not self._uncoupled or (quantity == "forward_dynamics" and not self._eliminates):
            return None
        self._arguments.refuse_closed()
        call = self._found_call(quantity)
        return call.for_one_sample() if isinstance(call, KernelCall) else None

    def _call_for(self, quantity: str, details: tuple[Any, ...] = (), *, tree: bool = False) -> Call:
        """Return the call of a quantity, whose kernel is compiled the first time."""
        return self._found_call(quantity, details, tree=tree).evaluate

    def _found_call(
        self, quantity: str, details: tuple[Any, ...] = (), *, tree: bool = False
    ) -> KernelCall | NumericCall | CoupledCall:
        tree = tree and not self._uncoupled
        key = (quantity, details, tree)
        call = self._calls.get(key)
        if call is None:
            # A fork acquires this lock first, so that it is free in the child.
            with COMPILE_LOCK:
                self._arguments.refuse_closed()
                call = self._calls.get(key)
                if call is None:
                    call = self._calls[key] = self._make_call(quantity, details, tree)
        return call

    def _make_call(
        self, quantity: str, details: tuple[Any, ...], tree: bool
    ) -> KernelCall | NumericCall | CoupledCall:
        described = kernel_quantity(quantity)
        checks = tuple(self._check(argument, tree) for argument in described.arguments)
        check_result = self._arguments.finite_acceleration if described.solves and not tree else None
        mechanism = replace(self._simplified, coupling=None) if tree else self._simplified
        options: dict[str, Any] = {
            "threads": self._threads,
            "validate": self._validate and not tree,
            "check_result": check_result,
        }
        if not compiles(mechanism, quantity):
            if not routines_evaluate(mechanism, quantity):
                return NumericCall(mechanism, quantity, details, checks, check_result=check_result)
            table = table_kernel(replace(mechanism, coupling=None), quantity, details)
            if mechanism.coupling is None:
                return KernelCall(table, checks, **options)
            in_tree = KernelCall(table, (np.asarray,) * len(checks), threads=self._threads, validate=False)
            options = {"threads": self._threads, "validate": self._validate, "shape": table.outputs[0].shape}
            return CoupledCall(self.model, mechanism, quantity, in_tree.evaluate, checks, **options)
        if quantity not in ON_CHAINS:
            kernel = quantity_kernel(mechanism, quantity, details)
            return KernelCall(kernel, checks, **options)
        chain = chain_of(mechanism, quantity, *details)
        key = (quantity, chain, tree)
        if key not in self._chain_kernels:
            self._chain_kernels[key] = chain_kernel(mechanism, quantity, chain)
        place = place_of(mechanism, chain, *details)
        return KernelCall(self._chain_kernels[key], checks, place=place, **options)

    def _check(self, argument: str, tree: bool) -> Callable[[Any], Floats]:
        if tree:
            return np.asarray
        if argument == "q":
            return self._arguments.q
        return lambda value: self._arguments.v(value, argument)

    # -- hooks, in tree coordinates -----------------------------------------------------------

    def _in_tree(self, quantity: str, *arguments: Floats, details: tuple[Any, ...] = ()) -> Floats:
        return self._call_for(quantity, details, tree=True)(*arguments)

    @classmethod
    def _is_native(cls, quantity: Quantity) -> bool:
        """Return True, because every quantity has a kernel."""
        return True

    def _frame_placements(self, q: Floats) -> Floats:
        return self._in_tree("frame_placements", q, details=self._all_frames)

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        return self._in_tree("inverse_dynamics", q, v, a)

    def _bias_torque(self, q: Floats, v: Floats) -> Floats:
        return self._in_tree("bias_torque", q, v)

    def _gravity_torque(self, q: Floats) -> Floats:
        return self._in_tree("gravity_torque", q)


_MAX_LIST_SIZE = 64
"""Size up to which a C loop over a Python list is faster than NumPy."""

_MAX_ACCELERATION = 1e300
"""Magnitude above which accelerations are checked one by one."""


class FastArguments(Arguments):
    """`Arguments` with fast checks of batches, without temporary arrays.

    The checks of `Arguments` read the data several times and make temporary arrays, which takes longer than a
    kernel. Here only the largest and the smallest entry are tested; if they are not finite or too large, the
    checks of `Arguments` follow, which name the invalid entry.
    """

    def q(self, q: Any) -> Floats:
        if not self.closed and _is_batch(q, self._q_shape) and _below(q, MAX_MAGNITUDE):
            if not self._floating:
                return np.asarray(q)
            quat = q[..., 3:7]
            off = np.einsum("...i,...i->...", quat, quat) - 1.0
            if (
                np.max(off, initial=0.0) <= UNIT_NORM_TOLERANCE
                and np.min(off, initial=0.0) >= -UNIT_NORM_TOLERANCE
            ):
                return np.asarray(q)
        return super().q(q)

    def v(self, v: Any, name: str = "v") -> Floats:
        if _is_batch(v, self._v_shape) and _below(v, MAX_MAGNITUDE):
            return np.asarray(v)
        return super().v(v, name)

    def finite_acceleration(self, a: Floats) -> Floats:
        if _below(a, _MAX_ACCELERATION):
            return a
        return super().finite_acceleration(a)


def _is_batch(array: Any, shape: tuple[int]) -> bool:
    return (
        type(array) is np.ndarray
        and array.dtype == np.float64
        and array.ndim > 1
        and array.shape[-1:] == shape
        and array.flags.c_contiguous
    )


def _below(array: Floats, bound: float) -> bool:
    """Check whether every entry is a number of magnitude below `bound`."""
    if array.size < _MAX_LIST_SIZE:
        return hypot(*array.reshape(-1).tolist()) < bound
    # If any entry is NaN, minimum and maximum are NaN, and both comparisons are false.
    return bool(np.max(array) < bound and np.min(array) > -bound)
