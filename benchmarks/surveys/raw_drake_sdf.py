"""Drake alone on a file of SDF: mass matrix, bias and poses at states given by the names of joints.

No dynx in here. A joint has the name that Drake gives it: the models around it and its own name, with ``::``
between them. A joint of two axes has its coordinates in their order.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex

_LOGGER = logging.getLogger("drake")


@dataclass(frozen=True)
class Answer:
    """Mass matrix (nv, nv), bias (nv,) with gravity, and poses (4, 4) in the world by the name of the link.

    Rows are the coordinates that were asked for. Those of a free base come first: linear velocity, then
    angular, in the axes of the base.
    """

    mass_matrix: Any
    bias: Any
    poses: dict[str, Any]


class DrakeRobot:
    """A file of SDF in Drake."""

    def __init__(self, file: Path, packages: Mapping[str, Path] = MappingProxyType({})) -> None:
        """Read a file, with the folders of ``model://NAME``. Raises RuntimeError as Drake does."""
        self.plant: Any = MultibodyPlant(0.0)
        parser: Any = Parser(self.plant)
        parser.SetAutoRenaming(True)
        for name, folder in packages.items():
            parser.package_map().Add(name, str(folder))
        # Drake knows the format of a file by the end of its name.
        named = file.with_name(f"{file.name}.sdf") if file.suffix == ".world" else file
        if named != file:
            named.write_bytes(file.read_bytes())
        # Others in this process listen to what Drake warns of.
        level = _LOGGER.level
        _LOGGER.setLevel(logging.ERROR)
        try:
            parser.AddModels(str(named))
            self.plant.Finalize()
        finally:
            _LOGGER.setLevel(level)
        for index in self.plant.GetJointActuatorIndices():
            # Drake counts the rotors of its own elements <drake:...> in the mass matrix.
            self.plant.get_joint_actuator(index).set_default_rotor_inertia(0.0)
        self.joints: dict[str, Any] = {}
        for number in self.plant.GetJointIndices():
            joint = self.plant.get_joint(number)
            if joint.num_velocities():
                self.joints[self._scoped(joint)] = joint
        bodies = [
            self.plant.get_body(index)
            for instance in range(self.plant.num_model_instances())
            for index in self.plant.GetBodyIndices(ModelInstanceIndex(instance))
        ]
        self.links = {self._scoped(body): body for body in bodies if body is not self.plant.world_body()}
        self.free = {name for name, body in self.links.items() if body.is_floating_base_body()}

    def rounds_an_axis(self) -> bool:
        """Check whether a joint turns about another axis than its own: Drake takes x, y or z for one within
        some 1e-8 of it."""
        context = self.plant.CreateDefaultContext()
        for joint in self.joints.values():
            if joint.type_name() != "revolute":
                continue
            joint.set_angle(context, 1.0)
            R = joint.frame_on_child().CalcPose(context, joint.frame_on_parent()).rotation().matrix()
            axis = joint.revolute_axis()
            if np.abs(R @ axis - axis).max() > 1e-13:
                return True
        return False

    def evaluate(
        self,
        coordinates: Sequence[tuple[str, int]],
        followers: Mapping[tuple[str, int], tuple[tuple[str, int], float, float]],
        base: str | None,
        q: Any,
        v: Any,
        gravity: Any,
    ) -> Answer:
        """Evaluate at a state of these coordinates, each a joint and the number of its axis.

        A follower has a leader, a multiplier and an offset. `base` is the link that moves freely, whose
        position and quaternion (x, y, z, w) come first in q.
        """
        plant = self.plant
        context = plant.CreateDefaultContext()
        plant.mutable_gravity_field().set_gravity_vector(np.array(gravity, dtype=float))
        first = 6 if base else 0
        nv = plant.num_velocities()
        turned = np.zeros((nv, len(v)))
        positions = plant.GetPositions(context).copy()
        values = dict(zip(coordinates, q[7 if base else 0 :], strict=True))
        column = {each: first + k for k, each in enumerate(coordinates)}
        rates = {each: (each, 1.0) for each in coordinates}
        for each, (leader, multiplier, offset) in followers.items():
            values[each] = multiplier * values[leader] + offset
            rates[each] = (leader, multiplier)
        for (name, number), value in values.items():
            joint = self.joints[name]
            positions[joint.position_start() + number] = value
            leader, multiplier = rates[name, number]
            turned[joint.velocity_start() + number, column[leader]] = multiplier
        if base:
            body = self.links[base]
            start = body.floating_positions_start()
            x, y, z, w = q[3:7]
            positions[start : start + 7] = [w, x, y, z, *q[:3]]
        plant.SetPositions(context, positions)
        extra = np.zeros(nv)
        if base:
            R = plant.EvalBodyPoseInWorld(context, body).rotation().matrix()
            at = body.floating_velocities_start_in_v()
            turned[at : at + 3, 3:6] = turned[at + 3 : at + 6, :3] = R
            # The acceleration of a base at rest in dynx's coordinates: its linear velocity turns with it.
            extra[at + 3 : at + 6] = R @ np.cross(v[3:6], v[:3])
        plant.SetVelocities(context, turned @ v)
        M = np.array(plant.CalcMassMatrix(context))
        bias = np.array(plant.CalcBiasTerm(context)) - np.array(plant.CalcGravityGeneralizedForces(context))
        bias = turned.T @ (bias + M @ extra)
        poses = {
            name: np.array(plant.EvalBodyPoseInWorld(context, each).GetAsMatrix4())
            for name, each in self.links.items()
        }
        return Answer(turned.T @ M @ turned, bias, poses)

    def _scoped(self, element: Any) -> str:
        return f"{self.plant.GetModelInstanceName(element.model_instance())}::{element.name()}"
