"""A temporary folder that cannot be written is named, wherever dynx writes into one."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from dynx.errors import TemporaryFolderError
from dynx.files.temporary import temporary_file, temporary_folder

ROOT = Path(__file__).parents[2]

FULL = """
import resource, tempfile
import dynx
from dynx.world import Scene, World, box
world = World(Scene('box', bodies=(box('box', (0.1, 0.1, 0.1), mass=1.0),)), 'pybullet')
tempfile.gettempdir()
resource.setrlimit(resource.RLIMIT_FSIZE, (16, 16))  # no file gets longer
def doctor():
    from dynx.doctor import diagnose
    # A robot that cannot be examined is a line of the report.
    found = str(diagnose('double_pendulum')).partition('TemporaryFolderError: ')[2]
    raise dynx.errors.TemporaryFolderError(found.removesuffix(')>'))
def viewer():
    from dynx.viewer.browser import Client
    Client('title', antialiasing=True)
for program in (
    lambda: dynx.backend('pybullet', dynx.load('double_pendulum')),
    lambda: World(Scene('box', bodies=(box('box', (0.1, 0.1, 0.1), mass=1.0),)), 'pybullet'),
    lambda: world.restore(world.save()),
    doctor,
    viewer,
):
    try:
        program()
        print('no error')
    except dynx.errors.TemporaryFolderError as error:
        print(error)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="bounds the length of files by a limit of the process")
def test_a_full_temporary_folder_is_named_by_all_that_write_into_it(tmp_path: Path) -> None:
    for name in ("pybullet", "viser"):
        pytest.importorskip(name)
    run = subprocess.run(
        [sys.executable, "-B", "-c", FULL],
        capture_output=True,
        text=True,
        env={"PATH": "", "TMPDIR": str(tmp_path), "HOME": str(Path.home())},
    )
    assert run.returncode == 0, run.stderr
    wanted = (
        f"the temporary folder {tmp_path} cannot be written: File too large; free some space there, or name "
        "another folder in TMPDIR"
    )
    assert run.stdout.splitlines() == [wanted] * 5


@pytest.mark.parametrize("make", [temporary_folder, temporary_file])
def test_a_temporary_folder_that_is_not_there_is_named(
    make: object, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    assert callable(make)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "absent"))
    with pytest.raises(TemporaryFolderError, match=r"temporary folder .*absent cannot be written: No such"):
        make().__enter__()


def test_errors_of_other_files_stay(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), temporary_folder() as folder:
        (tmp_path / "absent").read_bytes()
    assert not folder.exists()


def test_no_other_module_makes_temporary_files() -> None:
    importing = set()
    for path in (ROOT / "dynx").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)) if "tempfile" in text else ():
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if "tempfile" in names or (isinstance(node, ast.ImportFrom) and node.module == "tempfile"):
                importing.add(path.relative_to(ROOT).as_posix())
    assert importing == {"dynx/files/temporary.py"}
