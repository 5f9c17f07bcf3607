"""Classes by name, names that a package imports on use, and methods whose body lies above their class."""

from __future__ import annotations

import os
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from dynx.backends import installed_backends
from dynx.errors import ArgumentError, BackendError, UnknownBackendError
from dynx.registry import ClassRegistry, door, installed_entry_points


class Tool(ABC):
    @abstractmethod
    def grasp(self) -> None: ...

    @abstractmethod
    def release(self) -> None: ...


class Gripper(Tool):
    def grasp(self) -> None: ...

    def release(self) -> None: ...


class Suction(Tool):
    def grasp(self) -> None: ...


@pytest.fixture
def tools() -> ClassRegistry[Tool]:
    """Registry of a kind that packages do not add to."""
    return ClassRegistry(
        "tool",
        None,
        {"gripper": f"{__name__}:Gripper", "suction": f"{__name__}:Suction"},
        lambda: Tool,
        error=BackendError,
        unknown=UnknownBackendError,
    )


def test_a_kind_without_a_group_has_only_classes_of_dynx_and_of_the_program(
    tools: ClassRegistry[Tool],
) -> None:
    assert tools.names() == ("gripper", "suction")
    tools.register("magnet", lambda: Gripper)
    assert tools.names() == ("gripper", "suction", "magnet")
    assert tools.find("gripper") is tools.find("magnet") is Gripper
    tools.unregister("magnet")
    assert tools.names() == ("gripper", "suction")
    with pytest.raises(UnknownBackendError, match="no tool 'magnet'"):
        tools.find("magnet")


def test_an_incomplete_class_is_refused_with_what_it_lacks(tools: ClassRegistry[Tool]) -> None:
    with pytest.raises(
        BackendError, match=r"tool 'suction', provided by dynx itself.* Suction lacks release$"
    ):
        tools.find("suction")
    tools.register("bare", lambda: Tool)
    with pytest.raises(BackendError, match=r"provided by this program.* Tool lacks grasp, release$"):
        tools.find("bare")


def test_a_name_that_was_never_registered_cannot_be_unregistered(tools: ClassRegistry[Tool]) -> None:
    tools.register("magnet", lambda: Gripper)
    for name in ("gripper", "magnets"):
        with pytest.raises(UnknownBackendError, match=f"no tool '{name}' was registered"):
            tools.unregister(name)
    with pytest.raises(ArgumentError, match="'gripper' is taken"):
        tools.register("gripper", lambda: Gripper)


# -- the default engine ------------------------------------------------------------------------------


@pytest.mark.parametrize("pinocchio", [True, False])
def test_the_default_engine_is_one_that_is_installed(pinocchio: bool) -> None:
    if pinocchio:
        pytest.importorskip("pinocchio")
    hidden = "" if pinocchio else "import sys; sys.modules['pinocchio'] = None; "
    program = f"{hidden}from dynx.registry import DEFAULT_ENGINE; print(DEFAULT_ENGINE)"
    default = subprocess.check_output([sys.executable, "-c", program], text=True).strip()
    assert default in installed_backends()
    assert (default == "pinocchio") == pinocchio


# -- names that are imported on use ------------------------------------------------------------------


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """Package ``arm_kit`` of two modules, whose names are imported on use."""
    folder = tmp_path / "arm_kit"
    folder.mkdir()
    (folder / "__init__.py").write_text(
        "from dynx.registry import moved_names\n"
        "__getattr__ = moved_names(__name__, {'Claw': 'arm_kit.Hand'},\n"
        "    {'Hand': 'arm_kit.hands', 'Finger': 'arm_kit.hands:Digit'})\n"
    )
    (folder / "hands.py").write_text("class Hand: ...\nclass Digit: ...\n")
    (folder / "arms.py").write_text("")
    monkeypatch.syspath_prepend(tmp_path)
    yield import_module("arm_kit")
    for name in [name for name in sys.modules if name.partition(".")[0] == "arm_kit"]:
        del sys.modules[name]


def test_a_name_is_imported_at_its_first_use_and_kept(package: Any) -> None:
    assert "arm_kit.hands" not in sys.modules
    hand, finger = package.Hand, package.Finger
    hands = sys.modules["arm_kit.hands"]
    assert (hand, finger) == (hands.Hand, hands.Digit)
    assert (vars(package)["Hand"], vars(package)["Finger"]) == (hand, finger)


def test_a_module_of_the_package_is_one_of_its_names(package: Any) -> None:
    assert "arm_kit.arms" not in sys.modules
    assert package.arms is sys.modules["arm_kit.arms"]


def test_a_former_name_names_the_present_one(package: Any) -> None:
    with pytest.raises(ImportError, match=r"^arm_kit\.Claw is now arm_kit\.Hand$"):
        package.Claw  # noqa: B018
    with pytest.raises(ImportError, match=r"arm_kit\.Claw is now arm_kit\.Hand"):
        exec("from arm_kit import Claw")


@pytest.mark.parametrize("name", ["Foot", "_arms", "__wrapped__"])
def test_any_other_name_is_missing_as_from_any_module(package: Any, name: str) -> None:
    with pytest.raises(AttributeError, match=f"module 'arm_kit' has no attribute '{name}'"):
        getattr(package, name)
    assert not hasattr(package, name)


# -- methods whose body lies above -------------------------------------------------------------------


def lifted(self: Any, height: float) -> tuple[Any, float]:
    """Body of `Crane.lift`."""
    return self, height


def built(cls: type, height: float) -> tuple[type, float]:
    return cls, height


def crane() -> tuple[type[Any], type[Any]]:
    class Crane:
        @door(f"{__name__}:lifted")
        def lift(self, height: float) -> Any:
            """Lift the load."""

        @door(f"{__name__}:built")
        @classmethod
        def of_height(cls, height: float) -> Any:
            """Make a crane."""

    class Mobile(Crane): ...

    return Crane, Mobile


def test_a_door_leads_to_its_body_which_then_takes_its_place() -> None:
    Crane, Mobile = crane()
    assert vars(Crane)["lift"].__doc__ == "Lift the load."
    one = Mobile()
    assert one.lift(2.0) == (one, 2.0)
    assert vars(Crane)["lift"] is lifted
    assert "lift" not in vars(Mobile)
    assert one.lift(height=3.0) == (one, 3.0)


def test_a_door_in_a_class_gives_the_class() -> None:
    for first in (0, 1):
        cranes = crane()
        for kind in (cranes[first], *cranes):
            assert kind.of_height(2.0) == (kind, 2.0)
            assert kind().of_height(2.0) == (kind, 2.0)


def test_a_package_that_is_installed_while_the_program_runs_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    group = "acme.things"
    assert installed_entry_points(group) == ()
    metadata = tmp_path / "acme-1.0.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Metadata-Version: 2.1\nName: acme\nVersion: 1.0\n")
    (metadata / "entry_points.txt").write_text(f"[{group}]\nthing = acme:Thing\n")
    # The folder has changed, though perhaps within the resolution of its time.
    os.utime(tmp_path, ns=(0, tmp_path.stat().st_mtime_ns + 1))
    assert [point.name for point in installed_entry_points(group)] == ["thing"]
