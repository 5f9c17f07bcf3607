"""Calls of Drake's own binding, each with the work and the outputs of one method of a backend."""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.bindings.sample import FRAME, Call, Sample
from benchmarks.bindings.urdf_text import spelled_out
from dynx.engines.drake.library import JacobianWrtVariable, MultibodyForces, MultibodyPlant, Parser
from dynx.model import Model
from dynx.spatial.scalar import Floats


def binding_calls(model: Model, sample: Sample) -> dict[str, Call]:
    """Return the calls of Drake's binding on a plant that its own parser reads."""
    plant = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModelsFromString(spelled_out(model), "urdf")
    world = plant.world_frame()
    if plant.GetBodyByName(model.root).body_frame() != world:
        plant.WeldFrames(world, plant.GetFrameByName(model.root))
    plant.Finalize()
    context, forces = plant.CreateDefaultContext(), MultibodyForces(plant)
    applied = plant.get_applied_generalized_force_input_port()
    acceleration = plant.get_generalized_acceleration_output_port()
    wrt, origin = JacobianWrtVariable.kV, np.zeros(3)
    tool, frames = plant.GetFrameByName(FRAME), [plant.GetFrameByName(name) for name in model.frame_names]
    q, v, a, tau = sample.q, sample.v, sample.a, sample.tau

    def positions() -> None:
        plant.SetPositions(context, q)

    def state() -> None:
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)

    def forward_kinematics() -> Floats:
        positions()
        T: Floats = tool.CalcPoseInWorld(context).GetAsMatrix4()
        return T

    def all_frames() -> Floats:
        positions()
        return np.array([frame.CalcPoseInWorld(context).GetAsMatrix4() for frame in frames])

    def jacobian() -> Floats:
        positions()
        return _linear_first(plant.CalcJacobianSpatialVelocity(context, wrt, tool, origin, world, world))

    def frame_velocity() -> Floats:
        state()
        return _linear_first(tool.CalcSpatialVelocityInWorld(context).get_coeffs())

    def frame_acceleration() -> Floats:
        state()
        J = plant.CalcJacobianSpatialVelocity(context, wrt, tool, origin, world, world)
        bias = plant.CalcBiasSpatialAcceleration(context, wrt, tool, origin, world, world)
        return _linear_first(J @ a + bias.get_coeffs())

    def inverse_dynamics() -> Floats:
        state()
        plant.CalcForceElementsContribution(context, forces)
        torque: Floats = plant.CalcInverseDynamics(context, a, forces)
        return torque

    def forward_dynamics() -> Floats:
        state()
        applied.FixValue(context, tau)
        found: Floats = acceleration.Eval(context)
        return found

    def mass_matrix() -> Floats:
        positions()
        M: Floats = plant.CalcMassMatrix(context)
        return M

    def bias_torque() -> Floats:
        state()
        return np.asarray(plant.CalcBiasTerm(context) - plant.CalcGravityGeneralizedForces(context))

    def gravity_torque() -> Floats:
        positions()
        return np.asarray(-plant.CalcGravityGeneralizedForces(context))

    def center_of_mass() -> Floats:
        positions()
        center: Floats = plant.CalcCenterOfMassPositionInWorld(context)
        return center

    def center_of_mass_jacobian() -> Floats:
        positions()
        J: Floats = plant.CalcJacobianCenterOfMassTranslationalVelocity(context, wrt, world, world)
        return J

    def centroidal_momentum() -> Floats:
        state()
        center = plant.CalcCenterOfMassPositionInWorld(context)
        return _linear_first(plant.CalcSpatialMomentumInWorldAboutPoint(context, center).get_coeffs())

    def kinetic_energy() -> Floats:
        state()
        return np.asarray(plant.CalcKineticEnergy(context))

    def potential_energy() -> Floats:
        positions()
        return np.asarray(plant.CalcPotentialEnergy(context))

    return {
        "forward_kinematics": forward_kinematics,
        "all frames": all_frames,
        "jacobian": jacobian,
        "frame_velocity": frame_velocity,
        "frame_acceleration": frame_acceleration,
        "inverse_dynamics": inverse_dynamics,
        "forward_dynamics": forward_dynamics,
        "mass_matrix": mass_matrix,
        "bias_torque": bias_torque,
        "gravity_torque": gravity_torque,
        "center_of_mass": center_of_mass,
        "center_of_mass_jacobian": center_of_mass_jacobian,
        "centroidal_momentum": centroidal_momentum,
        "kinetic_energy": kinetic_energy,
        "potential_energy": potential_energy,
    }


def _linear_first(spatial: Any) -> Floats:
    return np.concatenate([spatial[3:], spatial[:3]])
