"""The cache of machine code: hits, keys, damaged files, eviction."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import platformdirs
import pytest

import dynx
from dynx.files.cache import keep, source_hash
from dynx.simd import cache
from dynx.simd.cache import load_kernel, program_recipe, source_version
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.simd.trace import trace

TWICE = trace(lambda x: 2.0 * x + 1.0, {"x": (2,)})
THRICE = trace(lambda x: 3.0 * x + 1.0, {"x": (2,)})


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache."""
    monkeypatch.delenv("DYNX_CACHE", raising=False)
    monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path / "cache"))
    return tmp_path / "cache" / "kernels"


class CountedProgram:
    """A program that counts how often it was requested."""

    def __init__(self, program: Program) -> None:
        self.program, self.times = program, 0

    def __call__(self) -> Program:
        self.times += 1
        return self.program


def values(kernel: Kernel) -> list[float]:
    x, found = np.array([[1.0, 10.0]]), np.empty((1, 2))
    kernel([x], [found])
    return [float(value) for value in found[0]]


def files(folder: Path) -> list[Path]:
    return sorted(folder.iterdir()) if folder.is_dir() else []


def test_a_cached_kernel_needs_no_program(folder: Path) -> None:
    made = CountedProgram(TWICE)
    for _ in range(3):
        kernel = load_kernel(b"twice", made)
        assert values(kernel) == [3.0, 21.0]
        assert (kernel.inputs, kernel.outputs) == (TWICE.inputs, TWICE.outputs)
    assert made.times == 1
    assert len(files(folder)) == 1


def test_everything_that_determines_the_code_is_part_of_the_key(
    monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    made = CountedProgram(TWICE)
    target = host()
    loads: list[Callable[[], Kernel]] = [
        lambda: load_kernel(b"twice", made),
        lambda: load_kernel(b"twicf", made),
        lambda: load_kernel(b"twice", made, settings=Settings(2)),
        lambda: load_kernel(b"twice", made, settings=Settings(target.lanes, fast=False)),
        lambda: load_kernel(b"twice", made, settings=Settings(target.lanes, segment=77)),
        lambda: load_kernel(b"twice", made, target=replace(target, cpu="x86-64")),
    ]
    if not target.triple.startswith("x86_64"):
        loads.pop()
    for load in [*loads, *loads]:
        load()
    assert made.times == len(loads)
    for name in ("compiler_version", "_emitter_version"):
        monkeypatch.setattr(cache, name, lambda: "another version")
        load_kernel(b"twice", made)
    assert made.times == len(loads) + 2 == len(files(folder))


@pytest.mark.parametrize("place", ["here.py", "inside/there.py", "inside/deeper/there.py"])
def test_the_source_of_a_package_includes_the_packages_inside_it(tmp_path: Path, place: str) -> None:
    """A kernel of the old source must not be used when a file changes, wherever it lies."""
    file = tmp_path / place
    file.parent.mkdir(parents=True, exist_ok=True)
    hashes = [source_hash(tmp_path)]
    for text in ("x = 1\n", "x = 2\n"):
        file.write_text(text, encoding="utf-8")
        hashes.append(source_hash(tmp_path))
    file.rename(file.with_name("other.py"))
    hashes.append(source_hash(tmp_path))
    assert len(set(hashes)) == 4
    (tmp_path / "notes.txt").write_text("no source", encoding="utf-8")
    assert source_hash(tmp_path) == hashes[-1]


def test_the_version_of_a_source_names_modules_and_packages() -> None:
    package, module = import_module("dynx.simd"), import_module("dynx.simd.user_code.arrays")
    assert package.__file__
    assert module.__file__
    folder, file = Path(package.__file__).parent, Path(module.__file__)
    assert source_version(package).endswith(f" {source_hash(folder)}")
    assert source_version(package, module).endswith(f" {source_hash(folder, file)}")
    assert source_version(package).startswith(f"{dynx.__version__} {np.__version__} ")


def test_recipes_of_programs() -> None:
    same = trace(lambda x: 2.0 * x + 1.0, {"x": (2,)})
    close = trace(lambda x: np.nextafter(2.0, 3.0) * x + 1.0, {"x": (2,)})
    named = trace(lambda y: 2.0 * y + 1.0, {"y": (2,)})
    shaped = trace(lambda x: (2.0 * x + 1.0)[None], {"x": (2,)})
    assert program_recipe(same) == program_recipe(TWICE)
    assert len({program_recipe(p) for p in (TWICE, THRICE, close, named, shaped)}) == 5


def _flip(content: bytes, place: int) -> bytes:
    return content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :]


def test_altered_files_are_replaced(folder: Path) -> None:
    """Files with flipped bytes, truncated, emptied or extended."""
    load_kernel(b"twice", CountedProgram(TWICE))
    (path,) = files(folder)
    whole = path.read_bytes()
    spoiled = [_flip(whole, place) for place in range(0, len(whole), max(1, len(whole) // 60))]
    spoiled += [whole[:length] for length in (0, 1, 13, 14, 40, 50, len(whole) // 2, len(whole) - 1)]
    spoiled += [whole + b"x", b"something else altogether"]
    for content in spoiled:
        path.write_bytes(content)
        made = CountedProgram(TWICE)
        assert values(load_kernel(b"twice", made)) == [3.0, 21.0]
        assert made.times == 1
        assert path.read_bytes() == whole


def test_code_that_cannot_be_linked_is_replaced(folder: Path) -> None:
    """The checksum is right, but the content is not an object file."""
    image = load_kernel(b"twice", CountedProgram(TWICE)).image
    (path,) = files(folder)
    keep(path.name, cache._content_of(replace(image, objects=(b"nothing of the kind",))))
    made = CountedProgram(TWICE)
    assert values(load_kernel(b"twice", made)) == [3.0, 21.0]
    assert made.times == 1


@pytest.mark.parametrize("damage", ["off", "a file", "read-only", "writable by others"])
def test_kernels_work_without_a_usable_folder(
    folder: Path, monkeypatch: pytest.MonkeyPatch, damage: str
) -> None:
    if damage == "off":
        monkeypatch.setenv("DYNX_CACHE", "0")
    elif damage == "a file":
        folder.parent.write_text("not a folder")
    elif damage == "read-only":
        # Root may write anywhere, so the system's result is simulated.
        folder.mkdir(parents=True)
        monkeypatch.setattr(os, "access", lambda path, mode: False)
    else:
        folder.mkdir(parents=True)
        folder.chmod(0o777)
    made = CountedProgram(TWICE)
    for _ in range(2):
        assert values(load_kernel(b"twice", made)) == [3.0, 21.0]
    assert made.times == 2
    assert files(folder) == []


def test_a_full_disk_is_no_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(source: object, target: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(os, "replace", full)
    assert values(load_kernel(b"twice", CountedProgram(TWICE))) == [3.0, 21.0]
    assert files(folder) == []


def test_the_default_folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("DYNX_CACHE_DIR")
    monkeypatch.setattr(platformdirs, "user_cache_path", lambda name: tmp_path / name)
    load_kernel(b"twice", CountedProgram(TWICE))
    assert len(files(tmp_path / "dynx" / "kernels")) == 1


def test_the_folder_is_private(folder: Path) -> None:
    load_kernel(b"twice", CountedProgram(TWICE))
    assert folder.stat().st_mode & 0o077 == 0


def test_the_least_recently_used_file_is_evicted(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recipes = [b"%d" % k for k in range(5)]
    paths: list[Path] = []
    for age, recipe in enumerate(recipes):
        load_kernel(recipe, CountedProgram(TWICE))
        (new,) = set(files(folder)) - set(paths)
        paths.append(new)
        os.utime(new, (time.time() - 1000 + age,) * 2)
    # Reading the oldest makes it the newest.
    made = CountedProgram(TWICE)
    load_kernel(recipes[0], made)
    assert made.times == 0
    monkeypatch.setattr("dynx.files.cache.MAX_CACHE_BYTES", 3 * paths[0].stat().st_size)
    load_kernel(b"one more", CountedProgram(TWICE))
    assert len(files(folder)) == 3
    assert {path.exists() for path in (paths[0], paths[4])} == {True}
    assert not any(paths[k].exists() for k in (1, 2, 3))


WRITER = """
import sys
import numpy as np
from dynx.simd.cache import load_kernel
from dynx.simd.trace import trace
for turn in range(6):
    for k in range(4):
        kernel = load_kernel(b"%d" % k, lambda: trace(lambda x: (k + 2.0) * x, {"x": (3,)}))
        x, y = np.ones((9, 3)), np.empty((9, 3))
        kernel([x], [y])
        assert (y == k + 2.0).all()
print("done")
"""


def test_several_processes_at_once(folder: Path) -> None:
    """All of them compile, write and read the same kernels, while another one damages the files."""
    writers = [
        subprocess.Popen([sys.executable, "-c", WRITER], stdout=subprocess.PIPE, text=True) for _ in range(3)
    ]
    while any(writer.poll() is None for writer in writers):
        for path in files(folder):
            if path.suffix == ".kernel":
                path.write_bytes(path.read_bytes()[:-7])
        time.sleep(0.05)
    assert [writer.communicate()[0].strip() for writer in writers] == ["done"] * 3
    assert {path.suffix for path in files(folder)} == {".kernel"}
