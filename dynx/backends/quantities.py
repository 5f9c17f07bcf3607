"""The table of quantities: everything that dynx computes of a robot, each described once.

This table is the source for the evaluation of calls (`dynx.backends.base`), the derivations
(`dynx.backends.hooks`), the compiled kernels, the benchmark, the 50-digit referee, the comparison of `dynx
agree` and the contract tests. The methods of `Backend` are written out for their users; a test compares them
with the table.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any, Literal

import numpy as np

from dynx.model import Mechanism, Model
from dynx.rbd import aba, centroidal, crba, jacobians, kinematics, rnea
from dynx.spatial.scalar import Array

Algorithm = Callable[..., Array]

Argument = Literal["q", "v", "a", "tau"]
"""q (..., nq) is a configuration; v, a and tau (..., nv) a velocity, an acceleration and a torque."""

Growth = Literal["joints", "pairs", "cubic"]
"""Growth of the number of operations of an algorithm: with the number of joints; with the number of pairs of
joints on one path to the root; or with the number of bodies times nv squared."""

Extent = int | Literal["nv", "10 n_links", "n_frames", "n_joints"]
"""Length of an axis of a result: a number, nv, ten for every link of the model, or one for every frame or
every joint, fixed ones included."""


def no_details(model: Model) -> tuple[Any, ...]:
    """Return no further arguments (see `Quantity.implied_details`)."""
    return ()


@dataclass(frozen=True)
class Quantity:
    """A quantity of a robot: a method of `Backend`, its result, and the algorithm that computes it.

    Mimic joints reduce a result by virtual work: with v_tree = S v, the last axis is multiplied by S from the
    right if its length is "nv", and the axis before it by S' from the left.
    """

    name: str
    """Name of the method of `Backend`."""

    arguments: tuple[Argument, ...]
    """The arrays the method takes, in order."""

    shape: tuple[Extent, ...]
    """Shape of one sample's result."""

    unit: str
    """Unit of the entries for revolute joints; for prismatic joints read m instead of rad."""

    algorithm: Algorithm
    """Function of `dynx.rbd`. Its arguments are the mechanism, the arrays in tree coordinates, and the
    details: further arguments, such as the number of a frame."""

    natural_magnitude: str
    """Name of the bound in `dynx.agreement.magnitudes` by which errors are divided."""

    source: str
    """Book or paper with the equation."""

    other_names: Mapping[str, str] = field(default_factory=dict)
    """Names of the quantity in other libraries."""

    options: tuple[str, ...] = ()
    """Keyword options of the method."""

    of_frame: bool = False
    """True if the quantity belongs to a frame. The details are then the number of the frame and, if the
    method has that option, the reference."""

    takes_poses: bool = True
    """True if the algorithm takes the poses of the bodies (`dynx.rbd.kinematics.Poses`) in place of q."""

    solves: bool = False
    """True if the result is the solution of an equation with the mass matrix. Where the mass matrix is
    singular there is no result; errors are backward errors; and mimic joints reduce the equation instead of
    the result."""

    growth: Growth = "joints"
    """Growth of the number of operations with the size of the robot."""

    refereed: bool = True
    """True if `dynx agree` compares it with 50 digits."""

    implied_details: Callable[[Model], tuple[Any, ...]] = no_details
    """Function that returns the details that follow from the model."""

    @property
    def hook(self) -> str:
        """Name of the hook of `EngineHooks` by which an engine computes the quantity natively."""
        return "_frame_placements" if self.name == "forward_kinematics" else f"_{self.name}"

    @property
    def reduces_columns(self) -> bool:
        """True if mimic joints multiply a result by S from the right."""
        return self.shape[-1:] == ("nv",) and not self.solves

    @property
    def reduces_rows(self) -> bool:
        """True if mimic joints multiply a result by S' from the left."""
        return len(self.shape) > 1 and self.shape[-2] == "nv"

    def shape_of(self, model: Model, nv: int | None = None) -> tuple[int, ...]:
        """Return the shape of one sample's result; in tree coordinates for the `nv` of the tree."""
        extents = {
            "nv": model.nv if nv is None else nv,
            "10 n_links": 10 * len(model.links),
            "n_frames": len(model.frame_names),
            "n_joints": len(model.joints),
        }
        return tuple(n if isinstance(n, int) else extents[n] for n in self.shape)

    def evaluate(self, mechanism: Mechanism, q: Array, *rest: Any) -> Array:
        """Evaluate the algorithm at the tree's configuration q (..., nq), other arguments and details."""
        first = kinematics.body_poses(mechanism, q) if self.takes_poses else q
        return np.asarray(self.algorithm(mechanism, first, *rest))


def _imported_late(module: str, name: str) -> Algorithm:
    """Return a function that stands for an algorithm whose long text few programs need."""

    def algorithm(*arguments: Any) -> Any:
        return getattr(import_module(module), name)(*arguments)

    algorithm.__module__, algorithm.__name__ = module, name
    return algorithm


LIBRARIES = ("Pinocchio", "Drake", "MuJoCo", "PyBullet")
"""Libraries whose names of quantities are in the table, in this order."""


def _elsewhere(*names: str | None) -> dict[str, str]:
    """Return the names of a quantity by library; None where a library has no such quantity."""
    return {library: name for library, name in zip(LIBRARIES, names, strict=False) if name is not None}


_AT_POINT = ("reference", "point")
_FORCES = ("external_forces", "force_reference", "joint_dynamics")
_OF_WRENCHES = ("frame", "reference", "external_forces", "force_reference")

_TABLE = (
    Quantity(
        "forward_kinematics",
        ("q",),
        (4, 4),
        "1, m",
        kinematics.frame_placement,
        "pose",
        "Featherstone 2008, section 4.4",
        _elsewhere("framesForwardKinematics", "CalcPoseInWorld", "mj_kinematics", "getLinkState"),
        of_frame=True,
    ),
    Quantity(
        "jacobian",
        ("q",),
        (6, "nv"),
        "m/rad, 1",
        jacobians.frame_jacobian,
        "jacobian",
        "Siciliano et al., eq. 3.30",
        _elsewhere("computeFrameJacobian", "CalcJacobianSpatialVelocity", "mj_jac", "calculateJacobian"),
        options=_AT_POINT,
        of_frame=True,
    ),
    Quantity(
        "jacobian_derivative",
        ("q", "v"),
        (6, "nv"),
        "m/(rad s), 1/s",
        jacobians.frame_jacobian_derivative,
        "jacobian rate",
        "Siciliano et al., eq. 3.30, differentiated in time",
        _elsewhere("getFrameJacobianTimeVariation", None, "mj_jacDot"),
        refereed=False,
        options=_AT_POINT,
        of_frame=True,
    ),
    Quantity(
        "frame_velocity",
        ("q", "v"),
        (6,),
        "m/s, rad/s",
        jacobians.frame_velocity,
        "velocity",
        "Featherstone 2008, section 2.8",
        _elsewhere("getFrameVelocity", "CalcSpatialVelocityInWorld", "mj_objectVelocity"),
        refereed=False,
        options=_AT_POINT,
        of_frame=True,
    ),
    Quantity(
        "frame_acceleration",
        ("q", "v", "a"),
        (6,),
        "m/s^2, rad/s^2",
        jacobians.frame_acceleration,
        "acceleration",
        "Featherstone 2008, section 2.11",
        _elsewhere(
            "getFrameClassicalAcceleration", "CalcSpatialAccelerationInWorld", "mj_objectAcceleration"
        ),
        refereed=False,
        options=_AT_POINT,
        of_frame=True,
    ),
    Quantity(
        "inverse_dynamics",
        ("q", "v", "a"),
        ("nv",),
        "N m",
        rnea.inverse_dynamics,
        "torque",
        "Luh, Walker and Paul 1980",
        _elsewhere("rnea", "CalcInverseDynamics", "mj_inverse", "calculateInverseDynamics"),
        options=_FORCES,
        takes_poses=False,
    ),
    Quantity(
        "forward_dynamics",
        ("q", "v", "tau"),
        ("nv",),
        "rad/s^2",
        aba.forward_dynamics,
        "solution",
        "Featherstone 2008, section 7.3",
        _elsewhere("aba", "get_generalized_acceleration_output_port", "mj_forward"),
        options=_FORCES,
        takes_poses=False,
        solves=True,
    ),
    Quantity(
        "mass_matrix",
        ("q",),
        ("nv", "nv"),
        "kg m^2",
        crba.mass_matrix,
        "inertia",
        "Featherstone 2008, section 6.2",
        _elsewhere("crba", "CalcMassMatrix", "mj_fullM", "calculateMassMatrix"),
        options=("joint_dynamics",),
        takes_poses=False,
        growth="pairs",
    ),
    Quantity(
        "bias_torque",
        ("q", "v"),
        ("nv",),
        "N m",
        rnea.bias_torque,
        "bias torque",
        "Siciliano et al., section 7.1.3",
        _elsewhere("nonLinearEffects", "CalcBiasTerm", "qfrc_bias"),
        options=_FORCES,
        takes_poses=False,
    ),
    Quantity(
        "gravity_torque",
        ("q",),
        ("nv",),
        "N m",
        rnea.gravity_torque,
        "gravity torque",
        "Siciliano et al., section 7.1.3",
        _elsewhere("computeGeneralizedGravity", "CalcGravityGeneralizedForces"),
        takes_poses=False,
    ),
    Quantity(
        "coriolis_matrix",
        ("q", "v"),
        ("nv", "nv"),
        "N m s/rad",
        _imported_late("dynx.rbd.coriolis", "coriolis_matrix"),
        "coriolis",
        "Echeandia and Wensing 2021, eq. 24",
        _elsewhere("computeCoriolisMatrix"),
        growth="pairs",
        refereed=False,
    ),
    Quantity(
        "inertial_regressor",
        ("q", "v", "a"),
        ("nv", "10 n_links"),
        "m/s^2, m^2/s^2, 1/s^2",
        _imported_late("dynx.rbd.regressor", "inertial_regressor"),
        "regressor",
        "Atkeson, An and Hollerbach 1986",
        _elsewhere("computeJointTorqueRegressor"),
        growth="cubic",
        refereed=False,
        # The frames of the links come first.
        implied_details=lambda model: (range(len(model.links)),),
    ),
    Quantity(
        "joint_wrenches",
        ("q", "v", "a"),
        ("n_joints", 6),
        "N, N m",
        _imported_late("dynx.rbd.joint_wrenches", "joint_wrenches"),
        "joint wrenches",
        "Featherstone 2008, table 5.1",
        # Pinocchio stores them in `data.f` during `rnea`, and has no function that returns them.
        _elsewhere(None, "get_reaction_forces_output_port", "cfrc_int", "getJointState"),
        options=_OF_WRENCHES,
    ),
    Quantity(
        "base_wrench",
        ("q", "v", "a"),
        (6,),
        "N, N m",
        _imported_late("dynx.rbd.joint_wrenches", "base_wrench"),
        "base wrench",
        "Featherstone 2008, table 5.1",
        options=_OF_WRENCHES,
    ),
    Quantity(
        "center_of_mass",
        ("q",),
        (3,),
        "m",
        centroidal.center_of_mass,
        "length",
        "Orin, Goswami and Lee 2013",
        _elsewhere("centerOfMass", "CalcCenterOfMassPositionInWorld", "subtree_com"),
    ),
    Quantity(
        "center_of_mass_jacobian",
        ("q",),
        (3, "nv"),
        "m/rad",
        centroidal.center_of_mass_jacobian,
        "linear jacobian",
        "Orin, Goswami and Lee 2013",
        _elsewhere(
            "jacobianCenterOfMass", "CalcJacobianCenterOfMassTranslationalVelocity", "mj_jacSubtreeCom"
        ),
        refereed=False,
    ),
    Quantity(
        "centroidal_momentum",
        ("q", "v"),
        (6,),
        "kg m/s, kg m^2/s",
        centroidal.centroidal_momentum,
        "momentum",
        "Orin, Goswami and Lee 2013",
        _elsewhere("computeCentroidalMomentum", "CalcSpatialMomentumInWorldAboutPoint", "subtree_angmom"),
        refereed=False,
    ),
    Quantity(
        "kinetic_energy",
        ("q", "v"),
        (),
        "J",
        centroidal.kinetic_energy,
        "kinetic energy",
        "Siciliano et al., section 7.1.1",
        _elsewhere("computeKineticEnergy", "CalcKineticEnergy", "mj_energyVel"),
        options=("joint_dynamics",),
    ),
    Quantity(
        "potential_energy",
        ("q",),
        (),
        "J",
        centroidal.potential_energy,
        "potential energy",
        "Siciliano et al., section 7.1.2",
        _elsewhere("computePotentialEnergy", "CalcPotentialEnergy", "mj_energyPos"),
        options=("joint_dynamics",),
    ),
)

QUANTITIES: dict[str, Quantity] = {quantity.name: quantity for quantity in _TABLE}
"""Every quantity by its name."""
