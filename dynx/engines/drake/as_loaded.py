"""A URDF file as Drake loads it: ``Parser(plant).AddModels(path)`` into a `MultibodyPlant`.

The plant is continuous (``time_step=0.0``) and has no scene graph, because the equations of motion are
compared and a discrete plant returns a step of its contact solver. Inverse dynamics is called as Drake's own
`InverseDynamics` system calls it, with the forces of `CalcForceElementsContribution`, which are gravity and
joint damping. A mimic joint becomes a constraint: kinematics, mass matrix and inverse dynamics leave it out,
and forward dynamics of a continuous plant raises an exception.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from dynx.engines.drake.coordinates import DrakeCoordinates
from dynx.engines.drake.file_checks import require_harmless
from dynx.engines.drake.library import (
    DRAKE_FAILURES,
    JacobianWrtVariable,
    MultibodyForces,
    MultibodyPlant,
    Parser,
    captured_log,
    drake_version,
    error_message,
)
from dynx.engines.drake.loaded_description import describe_joint, describe_link, remarks
from dynx.engines.drake.settings import CALLS, set_before_finalize, set_in_context
from dynx.errors import EngineError, UnusableEngineError, shown
from dynx.loaded.description import LoadedModel
from dynx.loaded.robot import LoadedRobot, lacking_joints
from dynx.model import Model
from dynx.spatial.scalar import Floats

_V = JacobianWrtVariable.kV
_ORIGIN: Floats = np.zeros(3)


class LoadedDrake(LoadedRobot):
    """A robot as Drake loads it; see `LoadedRobot` and the module docstring."""

    name: ClassVar[str] = "drake"
    CALLS: ClassVar[Mapping[str, str]] = CALLS

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        require_harmless(path, model)
        self._model = model
        self._plant = plant = MultibodyPlant(time_step=0.0)
        self._default_gravity: Floats = np.array(plant.gravity_field().gravity_vector())
        with self._convert_errors("load"), captured_log() as log:
            instances = Parser(plant).AddModels(str(path))
            plant.mutable_gravity_field().set_gravity_vector(np.array(model.gravity))
            self._bodies = self._find_bodies(instances)
            if model.root not in self._bodies:
                raise UnusableEngineError(f"drake lacks the root link {shown(model.root)} of {model.name}")
            if not model.floating and model.root != "world":
                plant.WeldFrames(plant.world_frame(), self._bodies[model.root].body_frame())
            self._joints = self._find_joints(instances)
            set_before_finalize(plant, self._joints, path, calls)
            plant.Finalize()
            self._context = plant.CreateDefaultContext()
            set_in_context(self._context, self._bodies, model, calls)
            self._forces = MultibodyForces(plant)
        self._remarks = remarks(log, str(path), plant)
        self._coordinates = self._find_coordinates()
        self._torque = plant.get_applied_generalized_force_input_port()
        self._acceleration = plant.get_generalized_acceleration_output_port()

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of Drake's distribution, such as ``1.51.1``."""
        return drake_version()

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: four lines for a fixed base; for a floating one the line with ``WeldFrames`` is
        omitted."""
        weld = "plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(root_link))\n"
        return (
            "plant = MultibodyPlant(time_step=0.0)\n"
            f"Parser(plant).AddModels(path)\n{'' if floating else weld}plant.Finalize()"
        )

    # -- quantities ------------------------------------------------------------------------------

    def link_poses(self, q: Floats) -> Floats:
        """Return the poses that ``EvalBodyPoseInWorld`` gives."""
        T = np.full((len(self._model.links), 4, 4), np.nan)
        with self._convert_errors("EvalBodyPoseInWorld"):
            self._place(q)
            for k, link in enumerate(self._model.links):
                if link.name in self._bodies:
                    body = self._bodies[link.name]
                    T[k] = self._plant.EvalBodyPoseInWorld(self._context, body).GetAsMatrix4()
        return T

    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the result of ``CalcJacobianSpatialVelocity`` with respect to v, linear rows first."""
        if link not in self._bodies:
            return np.full((6, self._model.nv), np.nan)
        frame, world = self._bodies[link].body_frame(), self._plant.world_frame()
        with self._convert_errors("CalcJacobianSpatialVelocity"):
            R = self._place(q)
            J = self._plant.CalcJacobianSpatialVelocity(self._context, _V, frame, _ORIGIN, world, world)
        return self._coordinates.forces_back(R, np.concatenate([J[3:], J[:3]]))

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the result of ``CalcMassMatrix``, which includes the reflected inertia of rotors."""
        with self._convert_errors("CalcMassMatrix"):
            R = self._place(q)
            return self._coordinates.matrix_back(R, np.array(self._plant.CalcMassMatrix(self._context)))

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque of ``CalcInverseDynamics`` with forces by ``CalcForceElementsContribution``."""
        plant, coordinates = self._plant, self._coordinates
        with self._convert_errors("CalcInverseDynamics"):
            R = self._place(q)
            plant.SetVelocities(self._context, coordinates.velocities(R, v))
            plant.CalcForceElementsContribution(self._context, self._forces)
            vdot = coordinates.accelerations(R, v, a)
            tau = np.array(plant.CalcInverseDynamics(self._context, vdot, self._forces))
        return coordinates.forces_back(R, tau)

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the output port ``generalized_acceleration``.

        Where a joint that the model lacks is held, the acceleration is solved from ``CalcMassMatrix`` and
        ``CalcInverseDynamics``.
        """
        if self._model.nv < self._plant.num_velocities():
            return self._solved_acceleration(q, v, tau)
        with self._convert_errors("compute forward dynamics of"):
            R = self._place(q)
            self._plant.SetVelocities(self._context, self._coordinates.velocities(R, v))
            self._torque.FixValue(self._context, self._coordinates.forces(R, tau))
            vdot = np.array(self._acceleration.Eval(self._context))
        return self._coordinates.accelerations_back(R, v, vdot)

    def close(self) -> None:
        """Do nothing: the interpreter frees all resources."""

    # -- what was loaded ----------------------------------------------------------------------

    def describe(self) -> LoadedModel:
        """Describe the model from the engine's bodies, joints and actuators; Drake merges no links.

        Joint friction is 0, because Drake has none and warns about files with joint friction.
        """
        rotors = {}
        for index in self._plant.GetJointActuatorIndices():
            actuator = self._plant.get_joint_actuator(index)
            rotors[actuator.joint().name()] = actuator
        names = [link.name for link in self._model.links]
        return LoadedModel(
            engine=self.name,
            links={
                name: describe_link(self._bodies[name], self._context)
                for name in names
                if name in self._bodies
            },
            joints={
                name: describe_joint(joint, rotors.get(name))
                for name, joint in self._joints.items()
                if joint.num_velocities()
            },
            base_frame=self.link_poses(self._model.neutral())[0],
            gravity=self._default_gravity,
            missing_links=tuple(name for name in names if name not in self._bodies),
            remarks=self._remarks,
        )

    # -- coordinates --------------------------------------------------------------------------

    def _find_bodies(self, instances: list[Any]) -> dict[str, Any]:
        plant = self._plant
        found = {
            plant.get_body(index).name(): plant.get_body(index)
            for instance in instances
            for index in plant.GetBodyIndices(instance)
        }
        if self._model.root == "world":
            found["world"] = plant.world_body()
        return found

    def _find_joints(self, instances: list[Any]) -> dict[str, Any]:
        """Return the file's joints by name, without the one to the world that is a weld or floats."""
        plant = self._plant
        known = {joint.name for joint in self._model.joints}
        joints = [
            plant.get_joint(index) for instance in instances for index in plant.GetJointIndices(instance)
        ]
        return {joint.name(): joint for joint in joints if joint.name() in known}

    def _find_coordinates(self) -> DrakeCoordinates:
        """Return the map between the coordinates of dynx and those of the plant."""
        plant, model = self._plant, self._model
        wanted = [self._joints.get(name) for name in model.joint_names]
        wrong = {
            name: "not there" if joint is None else str(joint.type_name())
            for name, joint in zip(model.joint_names, wanted, strict=True)
            if joint is None or joint.num_velocities() != 1
        }
        free = {
            str(joint.child_body().name()): joint
            for joint in map(plant.get_joint, plant.GetJointIndices())
            if joint.type_name() == "quaternion_floating"
        }
        floating = free.pop(model.root, None) if model.floating else None
        # A joint of six degrees of freedom cannot be held at zero: zero is no attitude.
        wrong |= dict.fromkeys(free, "free")
        if wrong:
            raise lacking_joints(self.name, model, wrong)
        if model.floating and floating is None:
            raise UnusableEngineError(f"drake does not let the base of {model.name} float")
        base = None if floating is None else (floating.position_start(), floating.velocity_start())
        joints = [joint for joint in wanted if joint is not None]
        return DrakeCoordinates(
            [joint.position_start() for joint in joints],
            [joint.velocity_start() for joint in joints],
            plant.num_positions(),
            plant.num_velocities(),
            base,
        )

    def _place(self, q: Floats) -> Floats:
        """Set the configuration of the context, and return the attitude of the base."""
        self._plant.SetPositions(self._context, self._coordinates.positions(q))
        return self._coordinates.attitude(q)

    @contextmanager
    def _convert_errors(self, call: str) -> Iterator[None]:
        """Raise the engine's exceptions as `EngineError` with its messages."""
        try:
            yield
        except EngineError:
            raise
        except DRAKE_FAILURES as error:
            raise EngineError(f"drake failed to {call} {self._model.name}: {error_message(error)}") from error
