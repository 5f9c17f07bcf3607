"""Time to open a chain of many joints: ``python -m benchmarks.many_joints [JOINTS]``.

Each backend is opened, or refuses, in seconds of processor time. Drake is then given the same chain by its
own calls, to tell what of it is Drake's own.
"""

from __future__ import annotations

import sys
import time
from importlib import import_module
from typing import Any

import numpy as np

import dynx
from dynx.errors import EngineLimitError
from dynx.model import Inertial, Joint, Link, Model, Pose

SPACING = 0.1


def chain(joints: int) -> Model:
    """Return a chain of revolute joints."""
    inertial = Inertial(1.0, ixx=0.1, iyy=0.1, izz=0.1)
    links = [Link(f"link{k}", inertial=inertial) for k in range(joints + 1)]
    origin = Pose((SPACING, 0.0, 0.0))
    return Model.build(
        "chain",
        links,
        [Joint(f"joint{k}", "continuous", f"link{k}", f"link{k + 1}", origin=origin) for k in range(joints)],
    )


def seconds_of_drake(joints: int) -> tuple[float, float]:
    """Return the seconds of Drake's `Finalize` and `CreateDefaultContext`."""
    # Drake's own types ask for arrays that no checker takes NumPy's for.
    math: Any = import_module("pydrake.math")
    tree: Any = import_module("pydrake.multibody.tree")
    plant: Any = import_module("pydrake.multibody.plant").MultibodyPlant(0.0)
    inertia = tree.SpatialInertia(1.0, np.zeros(3), tree.UnitInertia(0.1, 0.1, 0.1))
    parent = plant.AddRigidBody("link0", inertia)
    plant.WeldFrames(plant.world_frame(), parent.body_frame())
    offset = math.RigidTransform(np.array([SPACING, 0.0, 0.0]))
    axis = np.array([0.0, 0.0, 1.0])
    for k in range(joints):
        child = plant.AddRigidBody(f"link{k + 1}", inertia)
        frame = plant.AddFrame(tree.FixedOffsetFrame(f"frame{k}", parent.body_frame(), offset))
        plant.AddJoint(tree.RevoluteJoint(f"joint{k}", frame, child.body_frame(), axis))
        parent = child
    start = time.process_time()
    plant.Finalize()
    middle = time.process_time()
    plant.CreateDefaultContext()
    return middle - start, time.process_time() - middle


def main(joints: int) -> None:
    """Print the times."""
    model = chain(joints)
    for name in dynx.installed_backends():
        # The import of an engine is not that of a robot.
        dynx.backend(name, dynx.load("planar_2r")).close()
        start, outcome = time.process_time(), "opened"
        try:
            dynx.backend(name, model).close()
        except EngineLimitError as error:
            outcome = str(error)
        print(f"{name:10} {time.process_time() - start:.2f} s  {outcome}")
    if "drake" in dynx.installed_backends():
        for number in (joints // 8, joints // 4, joints // 2, joints):
            finalize, context = seconds_of_drake(number)
            print(f"Drake's own calls, {number} joints: Finalize {finalize:.2f} s, context {context:.2f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 5000)
