"""dynx: one interface over several rigid-body dynamics engines, with tests that they agree.

    import dynx

    model = dynx.load("ur5")                        # a path, URDF text, or a name (`dynx robots`)
    engine = dynx.backend("pinocchio", model)       # "pybullet", "mujoco", "drake", "reference"
    tau = engine.inverse_dynamics(q, v, a)
    report = dynx.agree(model)                      # do all engines return the same numbers?
    report = dynx.diagnose("my.urdf")               # why do they differ when they load the file themselves?
    report = dynx.same_robot("my.urdf", "my.xml")   # do two files describe the same robot?
    rollout = dynx.simulate(model, controller, reference, plant="pybullet")

Importing dynx imports no engine; each name is imported when it is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from dynx._version import __version__

if TYPE_CHECKING:
    from dynx import control, errors, ik, sim, trajectory, world
    from dynx.agreement import AgreementReport, agree
    from dynx.backends import Backend, backend, installed_backends, register
    from dynx.compiled.derivatives import Derivatives
    from dynx.compiled.parametric import ParametricDynamics, parametric
    from dynx.doctor import DoctorReport, compare_as_loaded, diagnose
    from dynx.ik import IKResult, inverse_kinematics
    from dynx.model import Model, Pose
    from dynx.model.library import robots
    from dynx.model.loading import load
    from dynx.model.rotations import (
        quat_from_rotation,
        quat_from_rpy,
        rotation_from_quat,
        rotation_from_rpy,
        rpy_from_quat,
        rpy_from_rotation,
    )
    from dynx.rbd.regressor import inertial_parameters
    from dynx.same import SameReport, same_robot
    from dynx.sim import (
        BatchRollouts,
        Noise,
        Payload,
        Rollout,
        Scenario,
        ScenePlant,
        Simulation,
        compare,
        simulate,
        simulate_batch,
    )
    from dynx.steppers.forces import ExternalForce
    from dynx.world import PDMotor, PositionMotor, Scene, TorqueMotor, VelocityMotor, World

__all__ = [
    "AgreementReport",
    "Backend",
    "BatchRollouts",
    "Derivatives",
    "DoctorReport",
    "ExternalForce",
    "IKResult",
    "Model",
    "Noise",
    "PDMotor",
    "ParametricDynamics",
    "Payload",
    "Pose",
    "PositionMotor",
    "Rollout",
    "SameReport",
    "Scenario",
    "Scene",
    "ScenePlant",
    "Simulation",
    "TorqueMotor",
    "VelocityMotor",
    "World",
    "__version__",
    "agree",
    "backend",
    "compare",
    "compare_as_loaded",
    "control",
    "diagnose",
    "errors",
    "ik",
    "inertial_parameters",
    "installed_backends",
    "inverse_kinematics",
    "load",
    "parametric",
    "quat_from_rotation",
    "quat_from_rpy",
    "register",
    "robots",
    "rotation_from_quat",
    "rotation_from_rpy",
    "rpy_from_quat",
    "rpy_from_rotation",
    "same_robot",
    "sim",
    "simulate",
    "simulate_batch",
    "trajectory",
    "world",
]

_HOME = {
    "AgreementReport": "dynx.agreement",
    "Backend": "dynx.backends",
    "BatchRollouts": "dynx.sim",
    "Derivatives": "dynx.compiled.derivatives",
    "DoctorReport": "dynx.doctor",
    "ExternalForce": "dynx.steppers.forces",
    "IKResult": "dynx.ik",
    "Model": "dynx.model",
    "Noise": "dynx.sim",
    "PDMotor": "dynx.world",
    "ParametricDynamics": "dynx.compiled.parametric",
    "Payload": "dynx.sim",
    "Pose": "dynx.model",
    "PositionMotor": "dynx.world",
    "Rollout": "dynx.sim",
    "SameReport": "dynx.same",
    "Scenario": "dynx.sim",
    "Scene": "dynx.world",
    "ScenePlant": "dynx.sim",
    "Simulation": "dynx.sim",
    "TorqueMotor": "dynx.world",
    "VelocityMotor": "dynx.world",
    "World": "dynx.world",
    "agree": "dynx.agreement",
    "backend": "dynx.backends",
    "compare": "dynx.sim",
    "compare_as_loaded": "dynx.doctor",
    "diagnose": "dynx.doctor",
    "inertial_parameters": "dynx.rbd.regressor",
    "installed_backends": "dynx.backends",
    "inverse_kinematics": "dynx.ik",
    "load": "dynx.model.loading",
    "parametric": "dynx.compiled.parametric",
    "quat_from_rotation": "dynx.model.rotations",
    "quat_from_rpy": "dynx.model.rotations",
    "register": "dynx.backends",
    "robots": "dynx.model.library",
    "rotation_from_quat": "dynx.model.rotations",
    "rotation_from_rpy": "dynx.model.rotations",
    "rpy_from_quat": "dynx.model.rotations",
    "rpy_from_rotation": "dynx.model.rotations",
    "same_robot": "dynx.same",
    "simulate": "dynx.sim",
    "simulate_batch": "dynx.sim",
}
_MOVED = {"compare_rollouts": "dynx.compare", "Push": "dynx.ExternalForce"}
_SUBPACKAGES = ("control", "distance", "errors", "ik", "sim", "trajectory", "world")
_OF_EXTRAS = ("envs", "testing", "training", "viewer")


# Hidden from type checkers, which would take any name for an attribute: they know the imports above.
if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _SUBPACKAGES:
            return import_module(f"dynx.{name}")
        if name in _OF_EXTRAS:
            raise AttributeError(f"dynx.{name} is not imported by itself; write: import dynx.{name}")
        if name in _MOVED:
            raise ImportError(f"dynx.{name} is now {_MOVED[name]}", name="dynx")
        if name not in _HOME:
            from dynx.registry import unknown_name

            raise AttributeError(unknown_name("module 'dynx'", name, __all__))
        from dynx.option_names import explained

        return explained(getattr(import_module(_HOME[name]), name))


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
