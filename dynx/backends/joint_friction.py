"""Torque of joint friction, viscous and dry, as a function of the velocity; coefficients of joints.

How joints stick and slide in a step is solved for by `dynx.steppers.implicit_joints`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.errors import ArgumentError, DTypeError, GainError, UnknownNameError, shown
from dynx.model import Model
from dynx.model.model import refuse_other_than_model
from dynx.model.numbers import checked_gain, is_real, read_only, real_array
from dynx.spatial.scalar import Array, Floats, sign, tanh

SLIP = 1e-2
"""Default speed [rad/s or m/s] at which compensation of dry friction has 76 % of its magnitude."""

MIN_SLIP = 1e-9
"""Smallest slip speed above 0 [rad/s or m/s]; the division overflows for smaller ones."""

Coefficients = bool | ArrayLike | Mapping[str, ArrayLike]
"""Coefficients: True for the description's, False for zero, one number, one per joint coordinate, or numbers
by the name of the joint (`coefficients_by_joint`), where joints that are not named have 0."""


@checks_types
@dataclass(frozen=True, eq=False)
class JointFriction:
    """Torque that overcomes damping and dry (Coulomb) friction: d v + f tanh(v / slip), with the sign of v.

    Inverse dynamics adds this torque to the joint torque. The friction that acts on the joint is its
    negative.

    With `slip` 0 the torque is d v + f sign(v), as with ``joint_dynamics=True`` in every backend. For a joint
    at rest, the torque between -f and f keeps the joint at rest. This torque is not a function of the
    velocity, so plants solve an equation for it (`dynx.rbd.joint_friction`). The coefficients of a mimic
    joint act on the joint that it follows, through the multiplier.
    """

    model: Model
    damping: Floats
    friction: Floats
    slip: float
    to_tree: Floats | None
    """Matrix from the model's coordinates to those of the tree, to which the coefficients then belong."""

    def __init__(
        self, model: Model, damping: Coefficients = True, friction: Coefficients = True, slip: float = SLIP
    ) -> None:
        """`damping` [N m s/rad or N s/m] and `friction` [N m or N] of the joints; see `Coefficients`.

        Raises GainError for coefficients that are negative, not finite or of a wrong length; UnknownNameError
        for a joint of a mapping without a coordinate; DTypeError or ShapeError for a value of a mapping that
        is no real number or array; ArgumentError for a slip speed that is neither 0 nor at least `MIN_SLIP`.
        """
        self._set(model, ("damping", damping), ("friction", friction), checked_slip("slip", slip))

    @classmethod
    def of_options(
        cls,
        model: Model,
        joint_damping: Coefficients = True,
        joint_friction: Coefficients = True,
        friction_slip: float = 0.0,
    ) -> JointFriction:
        """Return the friction of the options of a simulation. Errors name the option."""
        refuse_other_than_model(model)
        made = cls.__new__(cls)
        slip = checked_slip("friction_slip", friction_slip)
        made._set(model, ("joint_damping", joint_damping), ("joint_friction", joint_friction), slip)
        return made

    def _set(
        self, model: Model, damping: tuple[str, Coefficients], friction: tuple[str, Coefficients], slip: float
    ) -> None:
        """Set the fields; coefficients have the name of their argument."""
        own, coupling = JointDynamicsTerms(model), model.mechanism.coupling
        pairs = ((damping, own.damping), (friction, own.friction))
        # A description without coefficients is treated like False, so that nothing is computed of them.
        given = [
            value is True and bool(theirs.any()) if isinstance(value, bool) else value
            for (_, value), theirs in pairs
        ]
        # The coefficients of the description belong to the joints of the tree, given ones to the coordinates.
        in_tree_coordinates = coupling is not None and any(each is True for each in given)
        values = [
            self._coefficients(name, each, theirs, model, in_tree_coordinates)
            for ((name, _), theirs), each in zip(pairs, given, strict=True)
        ]
        to_tree = coupling.matrix() if coupling is not None and in_tree_coordinates else None
        for name, value in zip(
            ("model", "damping", "friction", "slip", "to_tree"), (model, *values, slip, to_tree), strict=True
        ):
            object.__setattr__(self, name, read_only(value) if isinstance(value, np.ndarray) else value)

    @cached_property
    def present(self) -> bool:
        """True if any coefficient is not zero."""
        return bool(self.damping.any()) or self._has_dry

    @property
    def sticks(self) -> bool:
        """True if any coefficient is not zero and `slip` is 0: each step then solves an equation for the
        torque."""
        return self.present and not self.slip

    @property
    def smooth(self) -> bool:
        """True if any coefficient is not zero and `slip` is above 0: the torque is then a smooth function of
        the velocity."""
        return self.present and bool(self.slip)

    @cached_property
    def _has_dry(self) -> bool:
        return bool(self.friction.any())

    @property
    def viscous(self) -> Floats:
        """Damping (nv,) of the model's coordinates [N m s/rad or N s/m]."""
        return np.asarray(self.viscous_for(self.damping))

    @property
    def dry(self) -> Floats:
        """Dry friction (nv,) of the model's coordinates [N m or N]."""
        return np.asarray(self.dry_for(self.friction))

    def viscous_for(self, damping: Array) -> Array:
        """Return the damping (nv,) of the model's coordinates, with other coefficients of the same shape."""
        return damping if self.to_tree is None else (self.to_tree**2).T @ damping

    def dry_for(self, friction: Array) -> Array:
        """Return the dry friction (nv,) of the model's coordinates, with other coefficients of the same
        shape: each joint of the tree depends on one of them."""
        return friction if self.to_tree is None else abs(self.to_tree).T @ friction

    def __call__(self, v: Array) -> Array:
        """Return the torque (..., nv) of friction at velocity `v` (..., nv), arrays of any scalar."""
        return self.torque_for(v, self.damping, self.friction)

    def torque_for(self, v: Array, damping: Array, friction: Array) -> Array:
        """Return the torque (..., nv) of friction with other coefficients, of the same shapes."""
        speed = v if self.to_tree is None else v @ self.to_tree.T
        torque = damping * speed
        if self._has_dry:
            torque = torque + friction * (tanh(speed / self.slip) if self.slip else sign(speed))
        return np.asarray(torque if self.to_tree is None else torque @ self.to_tree)

    @staticmethod
    def _coefficients(
        name: str, given: Coefficients, own: Floats, model: Model, in_tree_coordinates: bool
    ) -> Floats:
        if isinstance(given, bool):
            return own if given else np.zeros(model.mechanism.nv if in_tree_coordinates else model.nv)
        base = 6 if model.floating else 0
        refuse_text(name, given, model.nv - base)
        numbers = coefficients_by_joint(model, name, given)
        coefficients = checked_gain(name, numbers, model.nv - base, per="one for each joint")
        # Given coefficients apply to joints that own a coordinate, not to the base or to mimic joints.
        owners = [joint.mimic is None for joint in model.joints for _ in range(joint.n_rates)]
        joints = np.zeros(len(owners) if in_tree_coordinates else len(coefficients))
        joints[owners if in_tree_coordinates else slice(None)] = coefficients
        return np.concatenate([np.zeros(base), joints])


def checked_slip(name: str, slip: object) -> float:
    """Return a slip speed as a float. Raises ArgumentError unless it is 0 or at least `MIN_SLIP`."""
    if is_real(slip) and (slip == 0.0 or MIN_SLIP <= float(slip) < np.inf):
        return float(slip)
    raise ArgumentError(f"{name} is {shown(slip)}; wanted a speed: 0, or {MIN_SLIP:g} or more")


def coefficients_by_joint(
    model: Model, name: str, given: ArrayLike | Mapping[str, ArrayLike], others: float = 0.0
) -> ArrayLike:
    """Return numbers by the name of the joint as an array (joints,) or, with a number for each of n rollouts,
    (n, joints); joints that are not named have `others`. Anything but a mapping is returned unchanged.
    `JointFriction` takes one number for each joint.

    Raises UnknownNameError for a joint without a coordinate, GainError for numbers of different lengths.
    """
    if not isinstance(given, Mapping):
        return given
    base = 6 if model.floating else 0
    columns = [np.asarray(others) for _ in range(model.nv - base)]
    for joint, value in given.items():
        try:
            column = model.coordinate_index(joint) - base
        except (UnknownNameError, DTypeError) as error:
            raise type(error)(f"{name}: {error}") from None
        numbers = real_array(f"{name} of {shown(joint)}", value)
        for axis in range(model.joint(joint).n_rates):
            columns[column + axis] = numbers
    lengths = {column.shape for column in columns if column.shape}
    if len(lengths) > 1 or any(len(shape) > 1 for shape in lengths):
        raise GainError(f"{name} by joint: wanted one number for each joint, or one for each rollout")
    return np.stack(np.broadcast_arrays(*columns), axis=-1) if columns else np.zeros(0)


def armature_matrix(model: Model, armature: Coefficients, name: str = "armature") -> Floats:
    """Return what an armature [kg m^2 or kg], as `Coefficients`, adds to the mass matrix (nv, nv); errors
    have the `name` of the argument.

    Raises GainError and UnknownNameError as `JointFriction` does.
    """
    if isinstance(armature, bool):
        return JointDynamicsTerms(model).armature if armature else np.zeros((model.nv, model.nv))
    base = 6 if model.floating else 0
    refuse_text(name, armature, model.nv - base)
    numbers = coefficients_by_joint(model, name, armature)
    joints = checked_gain(name, numbers, model.nv - base, per="one for each joint")
    return np.diag(np.concatenate([np.zeros(base), joints]))


def refuse_text(name: str, given: object, joints: int, own: str = "True") -> None:
    """Raise GainError for coefficients that are a text; `own` stands for the description's."""
    if isinstance(given, str):
        raise GainError(
            f"{name} is {shown(given)}; wanted one number, an array ({joints},) in the order of the joints, "
            f"numbers by joint as in {{joint: number}}, or {own} for the values of the description"
        )
