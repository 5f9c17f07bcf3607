"""Evaluation of quantities by an engine's hooks, with arguments and results in model coordinates.

Control loops evaluate one sample thousands of times a second, so one sample has a straight path for every
quantity: one check of all arguments together, and the engine's hook. All else (batches, lists, invalid
arguments, quantities that dynx derives) is checked argument by argument and evaluated by `HookEvaluation`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.evaluation import HookEvaluation, Reduction, common_batch
from dynx.backends.hooks import EngineHooks, solution_or_nan, untranslated
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.quantities import QUANTITIES
from dynx.backends.solvability import Solvability
from dynx.backends.straight import BindingCall, StraightCall, straight_call
from dynx.errors import DTypeError, NotFiniteError, shown
from dynx.model import Model
from dynx.spatial.scalar import Floats

# Name, closing and pickling of a backend, apart from the quantities it computes.


Self = TypeVar("Self", bound="Lifecycle")
Made = TypeVar("Made")


class Lifecycle:
    """Base of backends that the constructor opens, and `close` or the end of a ``with`` block closes.

    A pickle holds the model and the options but not the engine; the unpickled copy creates its own engine.
    """

    name: ClassVar[str]
    """Name in reports and messages; by default that of the class in lower case."""

    model: Model
    """The robot."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if not hasattr(cls, "name"):
            cls.name = cls.__name__.lower()

    def __init__(self, model: Model, arguments: Arguments, *, validate: bool) -> None:
        self.model = model
        self._arguments = arguments
        self._options: dict[str, Any] = {"validate": validate}
        # `close` sets this to True, so that the checks run and raise ClosedError.
        self._validate = validate
        self._kept: dict[object, Any] = {}

    @property
    def engine_version(self) -> str:
        """Name and version of the engine; the name of the backend alone if the version is unknown."""
        return self.name

    @classmethod
    def require_engine(cls) -> None:
        """Raise NotInstalledError if the engine is missing, for a class that imports it late."""

    def close(self) -> None:
        """Release the resources of the engine; further calls raise ClosedError. Closing twice is harmless."""
        if not self._arguments.closed:
            self._validate = True
            self._arguments.closed = True
            self._kept.clear()
            self._release()

    def kept(self, key: object, make: Callable[[], Made]) -> Made:
        """Return what `make` returned for `key` when it was first needed; `close` releases it.

        Rooms above keep here what belongs to one backend, such as solvers. Two threads that need it at once
        may both make it; both get the same. Raises ClosedError.
        """
        try:
            found: Made = self._kept[key]
        except TypeError:
            raise DTypeError(f"key is {shown(key)}; wanted a hashable object") from None
        except KeyError:
            self._arguments.refuse_closed()
            if not callable(make):
                raise DTypeError(f"make is {shown(make)}; wanted a function without arguments") from None
            found = self._kept.setdefault(key, make())
            if self._arguments.closed:
                # Another thread closed this backend meanwhile.
                self._kept.clear()
        return found

    def _release(self) -> None:
        """Release the resources of the engine."""

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return partial(type(self), self.model, **self._options), ()

    def __repr__(self) -> str:
        return f"<{self.name} backend of {self.model.name}>"


Forces = Mapping[str, ArrayLike]

Key = str | tuple[str, ...]
"""Name of a quantity of the whole robot; for a frame, names of the quantity, the frame and any reference."""

ONE_FRAME, ALL_FRAMES = "frame_placement", "frame_placements"
"""Names under which `QuantityCalls` evaluates the poses of one frame and of all frames."""


class _PreparedQuantity(NamedTuple):
    """The entry of a quantity in the table, prepared for one backend."""

    arguments: tuple[str, ...]
    hook: str
    result_shape: tuple[int, ...]
    reduction: Reduction | None = None
    implied_details: tuple[Any, ...] = ()
    solves: bool = False


class QuantityCalls(Lifecycle, EngineHooks):
    """Base of backends: checks of arguments, evaluation of quantities, and terms shared by all engines."""

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        if not self.takes_ball_joints and model.ball_joints:
            from dynx.model.ball_joints import refuse_ball_joints_of_backend  # most robots have none

            refuse_ball_joints_of_backend(model, self.name)
        super().__init__(model, Arguments(model), validate=validate)
        self._mechanism = model.mechanism
        self._evaluation = HookEvaluation(self._mechanism, vectorized=self.vectorized)
        self._uncoupled = self._mechanism.coupling is None
        self._joint_terms = JointDynamicsTerms(model)
        self._solvability = Solvability(model)
        self._frame_index = {name: index for index, name in enumerate(model.frame_names)}
        all_poses = (len(self._frame_index), 4, 4)
        self._plans = {
            ONE_FRAME: _PreparedQuantity(("q",), "_frame_placement", (4, 4)),
            ALL_FRAMES: _PreparedQuantity(("q",), "_frame_placements", all_poses),
        }
        # Functions that call hooks without the translation of exceptions, made when a quantity is first
        # evaluated.
        self._straight: dict[Key, StraightCall] = {}

    @cached_property
    def _eliminates(self) -> bool:
        """True if forward dynamics is evaluated by its hook, rather than solved for by the mass matrix."""
        return self._uncoupled

    def _evaluate(self, key: Key, arguments: tuple[Any, ...]) -> Floats:
        """Check the arguments of the quantity `key`, with any leading axes, and evaluate it; an acceleration
        that is solved for is finite."""
        try:
            call = self._straight[key]
        except (KeyError, TypeError):
            return self._evaluate_samples(key, arguments)
        try:
            result = call(self, arguments)
        except (Exception, SystemExit):
            name = key if isinstance(key, str) else key[0]
            if not hasattr(getattr(self, self._plans[name].hook), "untranslated"):
                raise
            # The hook itself raises the error that its engine's exception stands for.
            return self._evaluate_samples(key, arguments)
        if type(result) is ndarray:
            return result
        return self._evaluate_samples(key, arguments) if result is None else np.asarray(result)

    def _evaluate_samples(self, key: Key, arguments: tuple[Any, ...]) -> Floats:
        """Evaluate the quantity `key` as `_evaluate` does, by the path that takes everything."""
        name, *frame = (key,) if isinstance(key, str) else key
        plan = self._plans.get(name) or self._plan(name)
        q = self._checked_q(arguments[0])
        rates = tuple(map(self._checked_v, arguments[1:], plan.arguments[1:]))
        details = self._frame_details(*frame)
        if plan.solves:
            common_batch(q, *rates)
            self._solvability.refuse_singular(False)
            if not self._eliminates:
                self._store_solution()
                return self._arguments.finite_acceleration(self._solved_acceleration(q, *rates))
        hook: Callable[..., Any] | None = getattr(self, plan.hook, None)
        if hook is None:
            hook = partial(self._derive, name)
            details = details or plan.implied_details
        elif plan.hook not in vars(self) and key not in self._straight:
            function = self._sample_hook(plan.hook, len(arguments), details)
            function = self._evaluation.of_sample(function, plan.reduction)
            binding = self._binding_call(plan.hook) if self._uncoupled else None
            self._store_straight(key, function, len(arguments), solves=plan.solves, binding=binding)
        result = self._evaluation(hook, plan.result_shape, q, *rates, args=details, reduce=plan.reduction)
        if not plan.solves:
            return result
        found = np.isfinite(result).all(axis=-1, keepdims=True)
        if not found.all():
            # An engine may divide by a pivot of zero, although the mass matrix is regular. Where the torque
            # of the velocities overflows, there is no acceleration.
            with suppress(NotFiniteError):
                result = np.where(found, result, self._solved_acceleration(q, *rates))
        return self._arguments.finite_acceleration(result)

    def _solved_acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Solve for the acceleration by the reduced mass matrix; NaN where it is singular, or where a torque
        overflows."""
        with np.errstate(over="ignore", invalid="ignore"):
            return solution_or_nan(
                self._evaluate("mass_matrix", (q,)), tau - self._evaluate("bias_torque", (q, v))
            )

    def _store_solution(self) -> None:
        """Store the function that solves for the acceleration of one sample."""
        hooks = ("_mass_matrix", "_bias_torque")
        if vars(self).keys().isdisjoint(hooks):
            functions = (untranslated(getattr(type(self), hook)) for hook in hooks)
            function = self._evaluation.solution_of_sample(*functions)
            self._store_straight("forward_dynamics", function, 3, solves=True)

    def _store_straight(
        self,
        key: Key,
        function: Callable[..., Any],
        arguments: int,
        *,
        solves: bool,
        binding: BindingCall | None = None,
    ) -> None:
        self._straight[key] = straight_call(
            self.model, function, arguments, validate=self._validate, solves=solves, binding=binding
        )
        if self._arguments.closed:
            # Another thread closed this backend meanwhile.
            self._straight.clear()

    def close(self) -> None:
        super().close()
        self._straight.clear()

    def _frame_details(self, *names: str) -> tuple[Any, ...]:
        """Return what hooks take for a frame, or a frame and a reference: its number, the checked name."""
        if not names:
            return ()
        return (self._index(names[0]), *map(self._arguments.reference, names[1:]))

    def _plan(self, name: str) -> _PreparedQuantity:
        quantity = QUANTITIES[name]
        plan = self._plans[name] = _PreparedQuantity(
            quantity.arguments,
            quantity.hook,
            quantity.shape_of(self.model, self._mechanism.nv),
            self._evaluation.reduction(rows=quantity.reduces_rows, columns=quantity.reduces_columns),
            quantity.implied_details(self.model),
            quantity.solves,
        )
        return plan

    def _index(self, frame: str) -> int:
        try:
            return self._frame_index[frame]
        except (KeyError, TypeError):
            return self.model.frame_index(frame)

    def _checked_q(self, q: Any) -> Floats:
        return self._arguments.q(q) if self._validate else q

    def _checked_v(self, v: Any, name: str = "v") -> Floats:
        return self._arguments.v(v, name) if self._validate else v
