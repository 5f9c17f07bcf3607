"""An interrupt while a package is imported is an interrupt, and not advice to install the package."""

from __future__ import annotations

import ast
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from dynx.errors import NotInstalledError, importing

ROOT = Path(__file__).parents[1]

INTERRUPTED = """
import os, signal, sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec

class Interrupted(MetaPathFinder, Loader):
    def find_spec(self, name, path=None, target=None):
        return ModuleSpec(name, self) if name.partition(".")[0] == package else None

    def exec_module(self, module):
        try:
            os.kill(os.getpid(), signal.SIGINT)
            for _ in range(1000): pass
        except KeyboardInterrupt:
            pass
        # What an extension module makes of it.
        raise ImportError("initialization failed") from None

import dynx, numpy as np
from dynx.errors import NotInstalledError
# A shell that starts the tests in the background lets them ignore interrupts.
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupted())
for package, program in PROGRAMS.items():
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]
    try:
        exec(program)
    except KeyboardInterrupt:
        print(package)
    except BaseException as error:
        print(package, repr(error))
"""

ENGINE = "dynx.backend('{0}', dynx.load('double_pendulum'))"

PROGRAMS = {
    "pinocchio": ENGINE.format("pinocchio"),
    "mujoco": ENGINE.format("mujoco"),
    "pybullet": ENGINE.format("pybullet"),
    "pydrake": ENGINE.format("drake"),
    "gymnasium": "import dynx.envs.library",
    "viser": "import dynx.viewer.library",
    "matplotlib": "import dynx.files.figures as f; f.new_figure(1.0, 1.0)",
    "mcap": "import dynx.sim.record.mcap_file as f; f.read_messages('none.mcap')",
    "ruckig": "import dynx.trajectory as t; "
    "t.time_optimal([0.0], [1.0], velocity=1.0, acceleration=1.0, jerk=1.0)",
    "toppra": "import dynx.trajectory as t; "
    "t.time_optimal_path([[0.0], [1.0]], velocity=1.0, acceleration=1.0, model=dynx.load('pendulum'))",
    "daqp": "import dynx.ik.velocity as v; e = np.eye(1); "
    "v.solve_programme(e, e[0], -e[0], e[0], e[:0], e[0, :0], e[:0], e[0, :0])",
    "trimesh": "import dynx.model.geometry.formats.gltf as g; g._trimesh()",
    "tomli_w": "import dynx.world as w; "
    "w.write_scene(w.Scene('s', bodies=(w.box('b', (1, 1, 1)),)), 's.toml')",
}
"""A program that imports each package."""


@pytest.mark.skipif(sys.platform == "win32", reason="os.kill ends the process on Windows")
def test_an_interrupt_during_an_import_is_not_a_missing_package(tmp_path: Path) -> None:
    run = subprocess.run(
        [sys.executable, "-c", f"PROGRAMS = {PROGRAMS!r}\n{INTERRUPTED}"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
    )
    assert run.stdout.splitlines() == list(PROGRAMS), run.stderr


def test_a_failed_import_is_a_missing_package() -> None:
    before = signal.getsignal(signal.SIGINT)
    with (
        pytest.raises(NotInstalledError, match=r"^needs it: pip install it \(no such thing\)$") as raised,
        importing("needs it: pip install it ({error})", OSError),
    ):
        raise OSError("no such thing")
    assert isinstance(raised.value.__cause__, OSError)
    assert signal.getsignal(signal.SIGINT) is before


@pytest.mark.parametrize("link", ["__cause__", "__context__"])
def test_an_interrupt_in_the_chain_of_an_error_is_one(link: str) -> None:
    error = ImportError("numpy failed to import")
    setattr(error, link, KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt), importing("needs it"):
        raise error


def fail_during_signal() -> None:
    signal.raise_signal(signal.SIGTERM)
    raise ImportError


def test_handlers_of_signals_are_as_before(monkeypatch: pytest.MonkeyPatch) -> None:
    got: list[int] = []
    before = signal.signal(signal.SIGTERM, lambda number, frame: got.append(number))
    try:
        own = signal.getsignal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt), importing("needs it"):
            fail_during_signal()
        assert got == [signal.SIGTERM]
        assert signal.getsignal(signal.SIGTERM) is own
    finally:
        signal.signal(signal.SIGTERM, before)


def test_no_other_handler_turns_a_failed_import_into_advice() -> None:
    found = []
    for path in sorted((ROOT / "dynx").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ExceptHandler) and node.type is not None:
                caught = any(name in ast.unparse(node.type) for name in ("ImportError", "failures"))
                advises = any("NotInstalledError" in ast.unparse(each) for each in node.body)
                if caught and advises:
                    found.append(f"{path.relative_to(ROOT).as_posix()}:{node.lineno}")
    assert [name.partition(":")[0] for name in found] == ["dynx/errors.py"], found
