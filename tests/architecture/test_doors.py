"""Doors: the methods whose bodies lie in a module above their class, and no other."""

from __future__ import annotations

import ast
import inspect
import re
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

DOORS = {
    "dynx.backends.base:Backend.inverse_kinematics": "dynx.ik.solver:inverse_kinematics",
    "dynx.backends.base:Backend.track": "dynx.ik.tracking.tracker:track",
    "dynx.backends.base:Backend.velocity_ik": "dynx.ik.velocity:velocity_ik",
    "dynx.model.elements:Inertial.from_parameters": "dynx.model.replaced_inertials:inertial_from_parameters",
    "dynx.model.model:Model.actuator_forces": "dynx.model.actuation:actuator_forces",
    "dynx.model.model:Model.order_of": "dynx.loaded.order:order_of",
    "dynx.model.model:Model.with_configuration": "dynx.model.named_configurations:with_configuration",
    "dynx.model.model:Model.with_inertials": "dynx.model.replaced_inertials:with_inertials",
    "dynx.model.model:Model.with_frame": "dynx.model.added_frames:with_frame",
    "dynx.model.model:Model.with_group_states": "dynx.model.srdf:with_group_states",
    "dynx.model.model:Model._repr_html_": "dynx.model.model_page:model_page",
    "dynx.model.tree:Tree._initial_configuration": "dynx.model.named_configurations:initial_configuration",
    "dynx.model.tree:Tree._named_configurations": "dynx.model.named_configurations:named_configurations",
    "dynx.model.model:Model.to_sdf": "dynx.model.sdf.writer:write_sdf",
    "dynx.model.model:Model.to_mjcf": "dynx.model.mjcf.writer:write_mjcf",
    "dynx.model.model:Model.to_urdf": "dynx.model.urdf.writer:write_urdf",
    "dynx.model.model:Model.view": "dynx.viewer.viewer:view",
    "dynx.sim.batch_rollouts:BatchRollouts.base_wrench": "dynx.sim.batch_wrenches:base_wrench_of",
    "dynx.sim.batch_rollouts:BatchRollouts.joint_wrenches": "dynx.sim.batch_wrenches:joint_wrenches_of",
    "dynx.sim.batch_rollouts:BatchRollouts.view": "dynx.viewer.viewer:view",
    "dynx.sim.record.rollout:Rollout._read_own_sensors": "dynx.sim.record.sensing:read_own_sensors",
    "dynx.sim.record.rollout:Rollout.read_sensors": "dynx.sim.record.sensing:read_sensors",
    "dynx.sim.record.rollout:Rollout.columns": "dynx.sim.record.csv_file:columns",
    "dynx.sim.record.rollout:Rollout.load": "dynx.sim.record.formats:load",
    "dynx.sim.record.rollout:Rollout.plot": "dynx.sim.record.plot:plot",
    "dynx.sim.record.rollout:Rollout.save": "dynx.sim.record.formats:save",
    "dynx.sim.record.rollout:Rollout.view": "dynx.viewer.viewer:view",
    "dynx.world.sensors.readings:Readings.plot": "dynx.world.sensors.plot:plot",
    "dynx.world.world:World.view": "dynx.viewer.viewer:view",
}


def stubs() -> dict[str, tuple[str, ast.FunctionDef]]:
    """Return target and stub of each door in the source."""
    found = {}
    for path in (ROOT / "dynx").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        if "@door(" not in text:
            continue
        module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
        for cls in (each for each in ast.walk(ast.parse(text)) if isinstance(each, ast.ClassDef)):
            for method in (each for each in cls.body if isinstance(each, ast.FunctionDef)):
                for decorator in method.decorator_list:
                    if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == "door":
                        target = ast.literal_eval(decorator.args[0])
                        found[f"{module}:{cls.name}.{method.name}"] = target, method
    return found


def test_these_are_all_doors() -> None:
    assert {name: target for name, (target, _) in stubs().items()} == DOORS


@pytest.mark.parametrize("name", DOORS)
def test_the_target_has_the_parameters_of_the_stub(name: str) -> None:
    target, stub = stubs()[name]
    module, _, function = target.partition(":")
    body = inspect.unwrap(getattr(import_module(module), function))
    text = inspect.getsource(body)
    (defined,) = (each for each in ast.parse(text).body if isinstance(each, ast.FunctionDef))
    own, above = stub.args, defined.args
    # The first parameter is the object of the method.
    assert [each.arg for each in own.args[1:]] == [each.arg for each in above.args[1:]]
    assert [ast.unparse(each) for each in own.defaults] == [ast.unparse(each) for each in above.defaults]
    for mine, theirs in zip(own.args[1:] + own.kwonlyargs, above.args[1:] + above.kwonlyargs, strict=True):
        assert mine.arg == theirs.arg
        assert ast.unparse(mine.annotation or ast.Constant(None)) == ast.unparse(
            theirs.annotation or ast.Constant(None)
        )
    mine_defaults, defaults = (
        [None if each is None else ast.unparse(each) for each in args.kw_defaults] for args in (own, above)
    )
    assert mine_defaults == defaults
    assert (own.kwarg is None) == (above.kwarg is None)


def test_ignored_imports_of_rooms_above_are_for_types() -> None:
    text = (ROOT / "dynx/backends/base.py").read_text(encoding="utf-8")
    (checking,) = (
        each
        for each in ast.parse(text).body
        if isinstance(each, ast.If) and ast.unparse(each.test) == "TYPE_CHECKING"
    )
    for_types = {each.module for each in checking.body if isinstance(each, ast.ImportFrom)}
    project = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    ignored = set(re.findall(r'"dynx\.backends\.base -> ([\w.]+)"', project))
    assert ignored == {module for module in for_types if module is not None and module.startswith("dynx.ik")}


def test_a_door_is_replaced_when_it_is_first_looked_up() -> None:
    """Until then the room above is not imported; then the class has the function itself."""
    program = """
import sys
from dynx.backends.base import Backend
assert not any(name.startswith("dynx.ik") for name in sys.modules)
Backend.track
from dynx.ik.tracking.tracker import track
assert vars(Backend)["track"] is track
assert Backend.track is track
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_what_a_fresh_process_loads_of_inverse_kinematics() -> None:
    program = """
import sys
import numpy as np
import dynx

def rooms():
    return {name.split(".")[1] for name in sys.modules if name.startswith("dynx.")}

engine = dynx.backend("reference", dynx.load(sys.argv[1]))
q = 0.3 * np.ones(engine.model.nq)
engine.inverse_dynamics(q, q, q)
assert rooms().isdisjoint({"ik", "distance", "world", "sim", "control", "trajectory", "compiled", "simd"})
frame = engine.model.frame_names[-1]
T = engine.forward_kinematics(q, frame)
assert engine.inverse_kinematics(T, frame)
assert rooms().isdisjoint({"distance", "world", "sim", "control", "trajectory"})
assert not any(name.startswith("dynx.ik.closed_forms") for name in sys.modules)
"""
    model = ROOT / "models" / "six_axis_arm.urdf"
    subprocess.run([sys.executable, "-c", program, str(model)], check=True)
