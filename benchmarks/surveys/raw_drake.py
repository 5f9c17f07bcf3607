"""Drake alone, run by raw_engine.py. No dynx in here.

Tasks and answers are those of raw_engine.py; the printed code ``load`` and ``calls`` is executed,
the latter before ``plant.Finalize()``. A floating base has in Drake the angular velocity before the linear
one, both in the axes of the world.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import MultibodyForces

FINALIZE = "plant.Finalize()"


def loaded(task: dict[str, Any]) -> Any:
    names: dict[str, Any] = {
        "MultibodyPlant": MultibodyPlant,
        "Parser": Parser,
        "path": task["path"],
        "root_link": task["root"],
    }
    exec("\n".join([task["load"].replace(FINALIZE, ""), *task["calls"], FINALIZE]), names)
    return names["plant"]


def answer(task: dict[str, Any]) -> list[dict[str, Any]]:
    plant = loaded(task)
    plant.mutable_gravity_field().set_gravity_vector(np.array(task["gravity"]))
    context = plant.CreateDefaultContext()
    forces = MultibodyForces(plant)
    joints = [plant.GetJointByName(name) for name in task["joints"]]
    root = plant.GetBodyByName(task["root"])
    columns = [joint.velocity_start() for joint in joints]
    if task["floating"]:
        at = root.floating_velocities_start_in_v()
        columns = [*range(at + 3, at + 6), *range(at, at + 3), *columns]
    found = []
    for state in task["states"]:
        q, v, a = np.zeros(plant.num_positions()), np.array(state["v"]), np.array(state["a"])
        turn = np.eye(len(columns))
        for joint, value in zip(joints, state["q"], strict=True):
            q[joint.position_start()] = value
        if task["floating"]:
            x, y, z, qx, qy, qz, qw = state["base"]
            start = root.floating_positions_start()
            q[start : start + 7] = [qw, qx, qy, qz, x, y, z]
        plant.SetPositions(context, q)
        if task["floating"]:
            R = plant.EvalBodyPoseInWorld(context, root).rotation().matrix()
            turn[:3, :3] = turn[3:6, 3:6] = R
            a[:3] += np.cross(v[3:6], v[:3])
        velocity, vdot = np.zeros(plant.num_velocities()), np.zeros(plant.num_velocities())
        velocity[columns], vdot[columns] = turn @ v, turn @ a
        plant.SetVelocities(context, velocity)
        plant.CalcForceElementsContribution(context, forces)
        tau = np.array(plant.CalcInverseDynamics(context, vdot, forces))[columns]
        M = np.array(plant.CalcMassMatrix(context))[np.ix_(columns, columns)]
        poses = [
            plant.EvalBodyPoseInWorld(context, plant.GetBodyByName(link)).GetAsMatrix4().tolist()
            for link in task["links"]
        ]
        found.append({"poses": poses, "M": (turn.T @ M @ turn).tolist(), "tau": (turn.T @ tau).tolist()})
    return found
