"""Robots and comparisons that the tests of the backends share."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from dynx.agreement.tolerances import BAR
from dynx.backends import Backend
from dynx.model import Joint, JointDynamics, Link, Mimic, Model
from dynx.model.elements import Inertial, JointType, Pose, Vector
from dynx.model.tree import Base
from dynx.spatial.scalar import Floats

BASES: tuple[Base, ...] = ("fixed", "floating")
BOX = Inertial(1.0, Pose((0.1, 0.02, 0.03), (0.3, 0.2, 0.1)), ixx=0.02, iyy=0.03, izz=0.04)
REFERENCES = ("local_world_aligned", "local", "world")
S2, S3 = 1 / math.sqrt(2), 1 / math.sqrt(3)

# (type, parent link, axis): every kind of joint, axes along the basis and across it, branches,
# fixed joints in the middle and at a tip.
_TREE: tuple[tuple[JointType, int, Vector], ...] = (
    ("revolute", 0, (0.0, 0.0, 1.0)),
    ("continuous", 1, (S3, -S3, S3)),
    ("fixed", 2, (1.0, 0.0, 0.0)),
    ("prismatic", 3, (0.0, 1.0, 0.0)),
    ("revolute", 3, (-1.0, 0.0, 0.0)),
    ("prismatic", 5, (S2, 0.0, -S2)),
    ("revolute", 5, (0.0, S2, S2)),
    ("fixed", 7, (1.0, 0.0, 0.0)),
    ("revolute", 0, (1.0, 0.0, 0.0)),
)


def mixed_robot(base: str = "fixed", *, mimic: bool = False) -> Model:
    """Return a branched robot with every kind of joint, oblique gravity, damping, friction and armature."""
    rng = np.random.default_rng(7)
    links = [Link(f"link{k}", _inertial(rng)) for k in range(len(_TREE) + 1)]
    # A massless link in the middle, and one at the end of a fixed joint.
    links[3] = replace(links[3], inertial=None)
    links[8] = replace(links[8], inertial=None)
    joints = [
        Joint(
            f"joint{k}",
            kind,
            f"link{parent}",
            f"link{k + 1}",
            _pose(rng),
            axis,
            dynamics=JointDynamics(*rng.uniform(0.1, 1.0, 3).tolist()),
        )
        for k, (kind, parent, axis) in enumerate(_TREE)
    ]
    if mimic:
        joints[5] = replace(joints[5], mimic=Mimic("joint1", -0.4, 0.2))
        joints[8] = replace(joints[8], mimic=Mimic("joint6", 1.7, -0.3))
    model = Model.build("mixed", links, joints, gravity=(0.3, -0.7, -9.81))
    return model.with_base("floating" if base == "floating" else "fixed").with_frame(
        "tip", "link8", _pose(rng)
    )


def chain(n: int, kind: JointType = "revolute") -> Model:
    """`n` joints in a row, each carrying a kilogram."""
    body = Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.2, 0.0, 0.3)
    links = [Link(f"link{k}", body) for k in range(n + 1)]
    joints = [
        Joint(f"joint{k}", kind, f"link{k}", f"link{k + 1}", Pose((0.0, 0.0, 0.1)), (0.0, k % 2, 1.0 - k % 2))
        for k in range(n)
    ]
    return Model.build("chain", links, joints)


def pair(root: Inertial | None, tip: Inertial | None, base: Base, prismatic: bool = False) -> Model:
    """Return a root and a first link with these inertials, and a second link with an ordinary one."""
    kind: JointType = "prismatic" if prismatic else "revolute"
    joints = [
        Joint("a", kind, "root", "tip", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), (0.6, 0.0, 0.8)),
        Joint("b", "revolute", "tip", "end", Pose((0.0, 0.3, 0.1)), (0.0, 1.0, 0.0)),
    ]
    links = [Link("root", root), Link("tip", tip), Link("end", BOX)]
    return Model.build("pair", links, joints, base=base, gravity=(0.3, -0.7, -9.81))


def motion(model: Model, seed: int = 0, size: tuple[int, ...] = ()) -> tuple[Floats, Floats, Floats]:
    """Return q, v and a third array like v, with the given leading axes."""
    rng = np.random.default_rng(seed)
    shape = (*size, model.nv)
    return model.random(rng, size), rng.standard_normal(shape), rng.standard_normal(shape)


def all_quantities(
    backend: Backend, q: Floats, v: Floats, x: Floats, *, forward_dynamics: bool = True
) -> dict[str, Floats]:
    """Return every quantity of the backend, for the last frame of the model; `x` serves as a and as tau."""
    frame = backend.model.frame_names[-1]
    results = {
        "forward_kinematics": backend.forward_kinematics(q),
        "forward_kinematics of one": backend.forward_kinematics(q, frame),
        "inverse_dynamics": backend.inverse_dynamics(q, v, x),
        "mass_matrix": backend.mass_matrix(q),
        "bias_torque": backend.bias_torque(q, v),
        "gravity_torque": backend.gravity_torque(q),
        "coriolis_matrix": backend.coriolis_matrix(q, v),
        "inertial_regressor": backend.inertial_regressor(q, v, x),
        "joint_wrenches": backend.joint_wrenches(q, v, x),
        "base_wrench": backend.base_wrench(q, v, x),
        "center_of_mass": backend.center_of_mass(q),
        "center_of_mass_jacobian": backend.center_of_mass_jacobian(q),
        "centroidal_momentum": backend.centroidal_momentum(q, v),
        "kinetic_energy": backend.kinetic_energy(q, v),
        "potential_energy": backend.potential_energy(q),
    }
    for reference in REFERENCES:
        results[f"jacobian {reference}"] = backend.jacobian(q, frame, reference=reference)
        results[f"jacobian_derivative {reference}"] = backend.jacobian_derivative(
            q, v, frame, reference=reference
        )
        results[f"frame_velocity {reference}"] = backend.frame_velocity(q, v, frame, reference=reference)
        results[f"frame_acceleration {reference}"] = backend.frame_acceleration(
            q, v, x, frame, reference=reference
        )
    if forward_dynamics:
        results["forward_dynamics"] = backend.forward_dynamics(q, v, x)
    return results


def assert_same(actual: dict[str, Floats], expected: dict[str, Floats]) -> None:
    """Assert that results are equal to the last bit, and of equal shape."""
    assert actual.keys() == expected.keys()
    for quantity, value in actual.items():
        assert np.shape(value) == np.shape(expected[quantity]), quantity
        np.testing.assert_array_equal(value, expected[quantity], err_msg=quantity)


def assert_close(actual: Floats, expected: Floats, size: float = 1.0, what: str = "") -> None:
    """Assert an error within `BAR` times the larger of `size` and the result, and equal shapes."""
    assert np.shape(actual) == np.shape(expected), what
    scale = max(size, float(np.max(np.abs(expected), initial=0.0)))
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=BAR * scale, err_msg=what)


def _pose(rng: np.random.Generator) -> Pose:
    x, y, z, roll, pitch, yaw = rng.uniform(-1.0, 1.0, 6).tolist()
    return Pose((x, y, z), (roll, pitch, yaw))


def _inertial(rng: np.random.Generator) -> Inertial:
    points = rng.uniform(-0.5, 0.5, (4, 3))
    tensor = sum(np.eye(3) * (p @ p) - np.outer(p, p) for p in points)
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = np.asarray(tensor).tolist()
    return Inertial(float(rng.uniform(0.5, 3.0)), _pose(rng), ixx, ixy, ixz, iyy, iyz, izz)
