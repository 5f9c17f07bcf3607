"""Names of other libraries: at every door dynx's own call is named, and both names exist."""

from __future__ import annotations

import copy
import importlib
import pickle
import re
from collections.abc import Callable, Iterator
from functools import cached_property
from importlib.util import find_spec
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.engine_names import TABLES, call_of_dynx
from dynx.registry import explains_names
from dynx.world import Scene, World, box

PLACES: dict[str, tuple[str, ...]] = {
    "PyBullet": ("pybullet",),
    "Pinocchio": ("pinocchio", "pinocchio:Model", "pinocchio:Inertia"),
    "MuJoCo": ("mujoco", "mujoco:MjData", "mujoco:MjModel"),
    "Drake": (
        "pydrake.multibody.plant:MultibodyPlant",
        "pydrake.multibody.plant",
        "pydrake.multibody.tree:Frame",
        "pydrake.multibody.inverse_kinematics",
        "pydrake.systems.controllers",
        "pydrake.systems.analysis",
        "pydrake.systems.analysis:Simulator",
    ),
    "roboticstoolbox": ("roboticstoolbox", "roboticstoolbox:Robot", "roboticstoolbox:DHRobot"),
    "Gymnasium": ("gymnasium", "gymnasium:Env", "gymnasium.vector"),
}
"""Modules and classes in which a library has its names."""

OTHERS = {name for each in QUANTITIES.values() for name in each.other_names.values()}
NAMES = sorted({name for table in TABLES.values() for name in table} | OTHERS)


def place(path: str) -> Any:
    module, _, attribute = path.partition(":")
    found = importlib.import_module(module)
    return getattr(found, attribute) if attribute else found


@pytest.mark.parametrize("library", TABLES)
def test_the_library_has_each_name(library: str) -> None:
    pytest.importorskip(PLACES[library][0].partition(".")[0].partition(":")[0])
    places = [place(path) for path in PLACES[library]]
    known = {name for each in places for name in (*dir(each), *getattr(each, "__annotations__", ()))}
    assert [name for name in TABLES[library] if name not in known] == []


def test_dynx_has_each_call() -> None:
    """Every dotted name of a clause is one of dynx, with its arguments where it names some."""
    found = 0
    for name in NAMES:
        clause = call_of_dynx(name)
        assert clause is not None
        for owner, attribute in re.findall(
            r"\b(dynx|dynx\.world|World|Backend|Model|Scene)\.(\w+)", clause.rpartition(" has ")[2]
        ):
            holder = {"dynx": dynx, "dynx.world": dynx.world}.get(owner) or getattr(dynx, owner)
            fields = getattr(holder, "__dataclass_fields__", {})
            of_world = owner == "World" and attribute in ("options", "settings")  # set by the constructor
            package = owner == "dynx" and find_spec(f"dynx.{attribute}") is not None
            known = hasattr(holder, attribute) or attribute in fields or of_world or package
            assert known, (name, owner, attribute)
            found += 1
    assert found > 100


def test_about_sixty_names_of_pybullet_are_known() -> None:
    assert len(TABLES["PyBullet"]) > 60


@pytest.fixture(scope="module")
def doors() -> Iterator[dict[str, Any]]:
    """Return what people type the names on."""
    model = dynx.load("six_axis_arm")
    scene = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),))
    simulation = dynx.Simulation(dynx.Scenario(model, None, model.neutral(), duration=0.1))
    engines = {name: dynx.backend(name, model) for name in dynx.installed_backends()}
    with World(scene) as world:
        packages = {each: importlib.import_module(each) for each in ("dynx.world", "dynx.sim", "dynx.ik")}
        yield {
            "dynx": dynx,
            **packages,
            "World": world,
            "Model": model,
            "Scene": scene,
            "Simulation": simulation,
            **engines,
        }
    for engine in engines.values():
        engine.close()
    simulation.close()


@settings(max_examples=200, deadline=None)
@given(st.sampled_from(NAMES), st.data())
def test_every_door_names_the_call_of_dynx(doors: dict[str, Any], name: str, data: st.DataObject) -> None:
    door = doors[data.draw(st.sampled_from(sorted(doors)))]
    if hasattr(door, name):  # such as Model.integrate, which is the call
        return
    clause = call_of_dynx(name)
    assert clause is not None
    with pytest.raises(AttributeError, match=re.escape(clause)):
        getattr(door, name)


@pytest.mark.parametrize(
    ("door", "wrong", "right"),
    [("World", "stpe", "step"), ("Model", "joint_name", "joint_names"), ("dynx", "simulte", "simulate")],
)
def test_another_name_is_answered_with_the_nearest(
    doors: dict[str, Any], door: str, wrong: str, right: str
) -> None:
    with pytest.raises(AttributeError, match=f"has no attribute '{wrong}'; did you mean '{right}'"):
        getattr(doors[door], wrong)


def test_an_error_inside_a_property_is_its_own() -> None:
    @explains_names
    class Holder:
        @property
        def broken(self) -> int:
            raise AttributeError("of the property")

        @cached_property
        def kept(self) -> int:
            return 3

    assert Holder().kept == 3
    with pytest.raises(AttributeError, match="of the property"):
        _ = Holder().broken


@pytest.mark.parametrize("again", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_objects_are_copied_as_before(again: Callable[[Any], Any]) -> None:
    model = dynx.load("six_axis_arm")
    assert again(model) == model
    with dynx.backend("reference", model) as engine:
        assert again(engine).model == model


@given(st.sampled_from(NAMES))
def test_a_name_written_with_underscores_is_the_same(name: str) -> None:
    """`getContactPoints` is typed as `get_contact_points` by who expects Python's way."""
    snake = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", name).lower()
    assert call_of_dynx(snake) is not None
    assert call_of_dynx(f"{name}x") is None


@pytest.mark.parametrize(
    ("owner", "name", "call"),
    [
        ("Model", "dof", "Model.nv"),
        ("Model", "with_payload", "dynx.sim.plant_model(model, payload)"),
        ("compiled", "com", "Backend.center_of_mass(q)"),
        ("compiled", "fk", "Backend.forward_kinematics(q, frame)"),
        ("compiled", "ik", "Backend.inverse_kinematics(pose, frame)"),
        ("dynx", "DynxError", "dynx.errors.DynxError"),
        ("dynx", "plant_model", "dynx.sim.plant_model(model, payload)"),
    ],
)
def test_short_names_name_the_call(doors: dict[str, Any], owner: str, name: str, call: str) -> None:
    with pytest.raises(AttributeError, match=re.escape(f"; dynx has {call}")):
        getattr(doors[owner], name)
