from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import dynx.backends.registry as registry
import dynx.registry as shared_registry
from dynx.backends import (
    Backend,
    backend,
    backend_class,
    backend_names,
    installed_backends,
    register,
    unregister,
)
from dynx.errors import ArgumentError, BackendError, NotInstalledError, UnknownBackendError
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import chain

BUILT_IN = ("reference", "pinocchio", "pybullet", "mujoco", "drake", "compiled")


class Mine(ReferenceBackend):
    """A backend of another package."""

    name = "mine"


def _offer(monkeypatch: pytest.MonkeyPatch, **values: str) -> None:
    points = EntryPoints(EntryPoint(name, value, registry.GROUP) for name, value in values.items())
    monkeypatch.setattr(shared_registry, "installed_entry_points", lambda group: points.select(group=group))


@pytest.fixture
def mine() -> Iterator[str]:
    register("mine", lambda: Mine)
    yield "mine"
    unregister("mine")


def test_the_backends_of_dynx_are_known_without_package_metadata(monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch)
    assert backend_names() == BUILT_IN
    for name in installed_backends():
        assert backend_class(name).name == name
    assert {"reference", "compiled"} <= set(installed_backends())


def test_every_installed_engine_can_be_used() -> None:
    """Tests of all installed backends would otherwise leave out one that dynx itself breaks."""
    packages = {"reference": "numpy", "drake": "pydrake", "compiled": "llvmlite"}
    here = [name for name in BUILT_IN if find_spec(packages.get(name, name)) is not None]
    assert [name for name in installed_backends() if name in BUILT_IN] == here


def test_the_entry_points_of_dynx_are_those_of_its_table() -> None:
    project = (Path(__file__).resolve().parents[2] / "pyproject.toml").read_text(encoding="utf-8")
    table = project.partition(f'[project.entry-points."{registry.GROUP}"]\n')[2].partition("\n\n")[0]
    offered = dict(line.replace('"', "").split(" = ") for line in table.splitlines())
    assert offered == registry.BUILT_IN


def test_a_backend_is_made_by_name_with_options() -> None:
    made = backend("pinocchio", chain(2), validate=False)
    assert isinstance(made, Backend)
    assert made.name == "pinocchio"
    assert made._validate is False


def test_listing_imports_no_engine() -> None:
    program = (
        "import sys; import dynx.backends as b; b.backend_names(); "
        "b.backend_class('reference'); "
        "print(sorted({'pinocchio', 'pybullet', 'mujoco', 'pydrake', 'llvmlite'} & sys.modules.keys()))"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("engine", ["pinocchio", "pybullet", "mujoco"])
def test_a_backend_without_its_engine_is_known_but_not_installed(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, engine, None)
    for module in [name for name in sys.modules if name.startswith(f"dynx.engines.{engine}.")]:
        monkeypatch.delitem(sys.modules, module)
    assert engine in backend_names()
    assert engine not in installed_backends()
    with pytest.raises(NotInstalledError, match=f"the engine '{engine}' needs"):
        backend(engine, chain(1))


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("pinochio", "did you mean 'pinocchio'"),
        ("Bullet", "did you mean 'pybullet'"),
        ("gazebo", "known: reference, pinocchio, pybullet, mujoco, drake, compiled"),
        ("", "known: reference"),
        ("x" * 10_000, r"\(10000 characters\)"),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest(
    name: str, hint: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    _offer(monkeypatch)
    with pytest.raises(UnknownBackendError, match=hint):
        backend(name, chain(1))


@pytest.mark.parametrize("name", [None, 3, ["pinocchio"], ReferenceBackend])
def test_a_name_must_be_text(name: Any) -> None:
    with pytest.raises(ArgumentError, match=r"a backend's name is of type \w+; wanted a str"):
        backend(name, chain(1))


@pytest.mark.parametrize(
    ("model", "hint"),
    [("ur5", r"type str; wanted a Model, such as dynx\.load\('ur5'\)"), (None, r"type NoneType.*dynx\.load")],
)
def test_anything_but_a_model_is_refused_with_an_example(model: Any, hint: str) -> None:
    with pytest.raises(ArgumentError, match=hint):
        backend("reference", model)


def test_an_unknown_option_is_refused_with_the_valid_ones() -> None:
    with pytest.raises(ArgumentError, match="'valdate'; its options: validate"):
        backend("pinocchio", chain(1), valdate=False)


# -- backends of a program --------------------------------------------------------------------


def test_a_program_can_register_its_own(mine: str) -> None:
    assert mine in backend_names()
    assert mine in installed_backends()
    assert type(backend(mine, chain(1))) is Mine


def test_a_registered_backend_can_be_unregistered(mine: str) -> None:
    unregister(mine)
    assert mine not in backend_names()
    with pytest.raises(UnknownBackendError, match="was registered"):
        unregister(mine)
    register(mine, lambda: Mine)


def test_a_name_that_is_taken_is_refused(mine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch, theirs="some.package:Theirs")
    for taken in (*BUILT_IN, mine, "theirs"):
        with pytest.raises(ArgumentError, match=f"'{taken}' is taken"):
            register(taken, lambda: Mine)
    assert backend_class("reference") is ReferenceBackend


@pytest.mark.parametrize("name", ["", None, 3])
def test_a_registered_name_must_be_text(name: Any) -> None:
    with pytest.raises(ArgumentError, match="wanted a str that is not empty"):
        register(name, lambda: Mine)


def test_a_loader_must_be_callable() -> None:
    loader: Any = "package:Mine"
    with pytest.raises(ArgumentError, match="of type str, not callable"):
        register("mine", loader)
    assert "mine" not in backend_names()


@pytest.mark.parametrize("loaded", [None, 3, dict, ReferenceBackend(chain(1))])
def test_a_loader_must_return_a_backend_class(loaded: Any) -> None:
    register("odd", lambda: loaded)
    try:
        with pytest.raises(BackendError, match=r"'odd', provided by this program, .*no subclass"):
            backend_class("odd")
        assert "odd" not in installed_backends()
    finally:
        unregister("odd")


# -- entry points of other packages -----------------------------------------------------------


def test_entry_points_add_backends(monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch, theirs=f"{__name__}:Mine")
    assert backend_names() == (*BUILT_IN, "theirs")
    assert backend_class("theirs") is Mine


def test_an_entry_point_cannot_take_the_name_of_a_built_in(monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch, reference=f"{__name__}:Mine")
    assert backend_class("reference") is ReferenceBackend
    assert backend_names() == BUILT_IN


def test_a_broken_entry_point_is_named_only_when_it_is_used(monkeypatch: pytest.MonkeyPatch) -> None:
    _offer(monkeypatch, broken="no_such_package.backends:Theirs", absent=f"{__name__}:Absent")
    assert backend_names() == (*BUILT_IN, "absent", "broken")
    assert not {"absent", "broken"} & set(installed_backends())
    backend("reference", chain(1))
    for name, cause in (("broken", ModuleNotFoundError), ("absent", AttributeError)):
        with pytest.raises(
            BackendError,
            match=rf"'{name}', provided by the entry point .* cannot be loaded: {cause.__name__}",
        ) as caught:
            backend(name, chain(1))
        assert type(caught.value.__cause__) is cause


def test_a_missing_engine_of_another_package_stays_not_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> type[Backend]:
        raise NotInstalledError("the backend 'far' needs the package far")

    register("far", missing)
    try:
        with pytest.raises(NotInstalledError, match="needs the package far"):
            backend_class("far")
        assert "far" not in installed_backends()
    finally:
        unregister("far")


def test_two_packages_with_one_name_are_both_named(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        EntryPoint("theirs", value, registry.GROUP) for value in ("one.package:A", "other.package:B")
    )
    monkeypatch.setattr(shared_registry, "installed_entry_points", lambda group: points)
    with pytest.raises(BackendError, match=r"more than once.*one\.package:A.*and.*other\.package:B"):
        backend_class("theirs")
    assert backend_names() == (*BUILT_IN, "theirs")
