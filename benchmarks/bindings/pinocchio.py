"""Calls of Pinocchio's own binding, each with the work and the outputs of one method of a backend."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from benchmarks.bindings.sample import FRAME, Call, Sample
from dynx.model import Model
from dynx.spatial.inertia import inertia_from_parameters, parameters_from_inertia
from dynx.spatial.scalar import Floats


def binding_calls(model: Model, sample: Sample) -> dict[str, Call]:
    """Return the calls of Pinocchio's binding on a model that its own parser reads.

    The binding leaves links that no joint moves out of the centre of mass, and gives a regressor for each
    joint instead of each link; the few lines of NumPy with which its user gets the outputs of dynx belong to
    the call.
    """
    engine = pin.buildModelFromUrdf(model.source)
    data, (q, v, a, tau) = engine.createData(), (sample.q, sample.v, sample.a, sample.tau)
    axes = pin.LOCAL_WORLD_ALIGNED
    numbers, tool = [engine.getFrameId(name) for name in model.frame_names], engine.getFrameId(FRAME)
    masses = [float(inertia.mass) for inertia in engine.inertias]
    share, rest_share = sum(masses[1:]) / sum(masses), masses[0] / sum(masses)
    at_rest = rest_share * np.array(engine.inertias[0].lever)
    rest_energy = -sum(masses) * float(engine.gravity.linear @ at_rest)
    to_links = link_matrix(engine, [link.name for link in model.links])

    def forward_kinematics() -> Floats:
        pin.forwardKinematics(engine, data, q)
        T: Floats = pin.updateFramePlacement(engine, data, tool).homogeneous
        return T

    def all_frames() -> Floats:
        pin.framesForwardKinematics(engine, data, q)
        placements = data.oMf
        return np.array([placements[frame].homogeneous for frame in numbers])

    def frame_velocity() -> Floats:
        pin.forwardKinematics(engine, data, q, v)
        velocity: Floats = pin.getFrameVelocity(engine, data, tool, axes).vector
        return velocity

    def frame_acceleration() -> Floats:
        pin.forwardKinematics(engine, data, q, v, a)
        acceleration: Floats = pin.getFrameClassicalAcceleration(engine, data, tool, axes).vector
        return acceleration

    def center_of_mass() -> Floats:
        center: Floats = share * pin.centerOfMass(engine, data, q, False)
        return center + at_rest

    def centroidal_momentum() -> Floats:
        momentum: Floats = pin.computeCentroidalMomentum(engine, data, q, v).vector
        x, y, z = (rest_share * data.com[0] - at_rest).tolist()
        hx, hy, hz, kx, ky, kz = momentum.tolist()
        momentum[3:] = kx + y * hz - z * hy, ky + z * hx - x * hz, kz + x * hy - y * hx
        return momentum

    return {
        "forward_kinematics": forward_kinematics,
        "all frames": all_frames,
        "jacobian": lambda: pin.computeFrameJacobian(engine, data, q, tool, axes),
        "jacobian_derivative": lambda: pin.frameJacobianTimeVariation(engine, data, q, v, tool, axes),
        "frame_velocity": frame_velocity,
        "frame_acceleration": frame_acceleration,
        "inverse_dynamics": lambda: pin.rnea(engine, data, q, v, a),
        "forward_dynamics": lambda: pin.aba(engine, data, q, v, tau),
        "mass_matrix": lambda: pin.crba(engine, data, q),
        "bias_torque": lambda: pin.nonLinearEffects(engine, data, q, v),
        "gravity_torque": lambda: pin.computeGeneralizedGravity(engine, data, q),
        "coriolis_matrix": lambda: pin.computeCoriolisMatrix(engine, data, q, v),
        "inertial_regressor": lambda: pin.computeJointTorqueRegressor(engine, data, q, v, a) @ to_links,
        "center_of_mass": center_of_mass,
        "center_of_mass_jacobian": lambda: share * pin.jacobianCenterOfMass(engine, data, q, False),
        "centroidal_momentum": centroidal_momentum,
        "kinetic_energy": lambda: np.asarray(pin.computeKineticEnergy(engine, data, q, v)),
        "potential_energy": lambda: np.asarray(pin.computePotentialEnergy(engine, data, q) + rest_energy),
    }


def link_matrix(engine: Any, links: list[str]) -> Floats:
    """Return the matrix (10 n_joints, 10 n_links) that turns the engine's regressor into that of `links`."""
    B = np.zeros((10 * (engine.njoints - 1), 10 * len(links)))
    # Pinocchio lists the upper triangle of the tensor column by column.
    engine_order = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
    for k, link in enumerate(links):
        frame = engine.frames[engine.getFrameId(link, pin.FrameType.BODY)]
        joint = frame.parentJoint - 1
        if joint >= 0:
            R, p = np.array(frame.placement.rotation), np.array(frame.placement.translation)
            moved = [
                parameters_from_inertia(inertia_from_parameters(unit).transform(R, p)) for unit in np.eye(10)
            ]
            B[10 * joint : 10 * joint + 10, 10 * k : 10 * k + 10] = np.stack(moved, axis=-1)[engine_order]
    return B
