"""Failures of PyBullet: exceptions, misread files, printed lines."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dynx.engines.pybullet import client as bullet_client
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.engines.pybullet.canonical_urdf import write_bullet_urdf
from dynx.errors import EngineError, NotInstalledError, TemporaryFolderError
from dynx.model import Inertial
from tests.backends.robots import BOX, all_quantities, chain, mixed_robot, motion, pair
from tests.engines.pybullet.robots import clients

bullet = pytest.importorskip("pybullet")


def test_the_engine_s_exceptions_become_engine_errors() -> None:
    model = mixed_robot()
    engine = PyBulletBackend(model)
    q, v, x = motion(model)
    bullet.disconnect(*clients(engine))
    calls: tuple[Callable[[], Any], ...] = (
        lambda: engine.forward_kinematics(q),
        lambda: engine.jacobian(q, model.frame_names[-1]),
        lambda: engine.inverse_dynamics(q, v, x),
        lambda: engine.mass_matrix(q),
    )
    for call in calls:
        with pytest.raises(EngineError, match="mixed") as caught:
            call()
        assert caught.value.__cause__ is not None
    # Otherwise it would disconnect a later client with the same number, whenever it is garbage-collected.
    engine.close()


def test_after_a_failed_step_the_engine_is_opened_anew() -> None:
    model = mixed_robot()
    engine = PyBulletBackend(model)
    q, v, x = motion(model)
    wanted = engine.forward_dynamics(q, v, x)
    bullet.disconnect(*clients(engine))
    with pytest.raises(EngineError):
        engine.forward_dynamics(q, v, x)
    np.testing.assert_array_equal(engine.forward_dynamics(q, v, x), wanted)
    engine.close()


@pytest.mark.parametrize(
    ("written", "read", "what"),
    [
        ('<mass value="1', '<mass value="2', "inertia of link"),
        ('type="continuous"', 'type="fixed"', "joint"),
        ('<axis xyz="', '<axis xyz="2e0 ', "axis"),
        ('<origin xyz="', '<origin xyz="9e0 ', "centre of mass"),
    ],
)
def test_values_that_bullet_misreads_raise(
    monkeypatch: pytest.MonkeyPatch, written: str, read: str, what: str
) -> None:
    monkeypatch.setattr(
        bullet_client, "write_bullet_urdf", lambda tree: write_bullet_urdf(tree).replace(written, read)
    )
    with pytest.raises(EngineError, match=f"has not read .*{what}"):
        PyBulletBackend(pair(BOX, BOX, "fixed"))


def test_inertia_that_bullet_drops_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    change = bullet.changeDynamics

    def forgetful(*args: Any, **options: Any) -> None:
        options.pop("localInertiaDiagonal", None)
        change(*args, **options)

    monkeypatch.setattr(bullet, "changeDynamics", forgetful)
    with pytest.raises(EngineError, match="has not read the inertia of link 0 of pair"):
        PyBulletBackend(pair(BOX, BOX, "fixed"))


def test_a_folder_that_cannot_be_written_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("tempfile.tempdir", "/nonexistent/folder")
    with pytest.raises(TemporaryFolderError, match=r"temporary folder /nonexistent/folder cannot be written"):
        PyBulletBackend(chain(2))


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    for tip in (None, Inertial(1.0, ixx=0.5, iyy=0.1, izz=0.1), Inertial(1.0, ixx=-0.1, iyy=0.1, izz=0.1)):
        model = pair(None, tip, "floating")
        with PyBulletBackend(model) as engine:
            all_quantities(engine, *motion(model), forward_dynamics=False)
    assert capfd.readouterr() == ("", "")


PROGRAM = """
import sys
print("before")
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.model import Joint, Link, Model
assert "pybullet" not in sys.modules
engine = PyBulletBackend(Model.build("m", [Link("a"), Link("b")], [Joint("j", "revolute", "a", "b")]))
print(engine.engine_version)
print("after", file=sys.stderr)
"""


def test_importing_the_engine_prints_nothing() -> None:
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120)
    assert run.stdout.splitlines()[0] == "before"
    assert run.stdout.splitlines()[1].startswith("pybullet 3.")
    assert run.stderr == "after\n"
    assert len(run.stdout.splitlines()) == 2


def test_a_missing_engine_says_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[pybullet\]'.*3\.11"):
        PyBulletBackend(chain(2))
