"""Files that are small, or empty inside, and would need memory or time without bound, are refused."""

from __future__ import annotations

import os
import re
import sys
import time
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, DescriptionError
from dynx.files.documents import MAX_LISTS_AND_TABLES, parse_json
from dynx.files.reading import MAX_BINARY_BYTES, named_file
from dynx.model.geometry import Mesh
from dynx.sim.record.csv_file import MAX_CELLS, MAX_TABLE
from dynx.world import ContactSensor, Scene, World, box, read_scene
from dynx.world.scene.files import MAX_KEY_PARTS, MAX_TOML
from dynx.world.sensors.sensor import MAX_SENSORS
from dynx.world.snapshot import MAGIC, MAX_STATE
from tests.security.attack import make_box, sparse

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(sys.platform == "win32", reason="truncating a file there fills it")
@pytest.mark.parametrize(
    "suffix", [".npz", ".mcap", ".csv", ".world", ".toml", ".json", ".stl", ".obj", ".glb"]
)
def test_a_file_of_holes_is_refused_before_it_is_read(suffix: str, tmp_path: Path) -> None:
    """Such a file has any size and takes no space on a disk or in an archive."""
    path = tmp_path / f"holes{suffix}"
    sparse(path, 2**40, MAGIC if suffix == ".world" else b"")
    readers: dict[str, Any] = {
        **dict.fromkeys((".npz", ".mcap"), dynx.Rollout.load),
        ".csv": lambda path: dynx.Rollout.load(path, dynx.load("pendulum")),
        ".world": World.read,
        **dict.fromkeys((".toml", ".json"), read_scene),
        **dict.fromkeys((".stl", ".obj", ".glb"), lambda path: Mesh(str(path)).triangles),
    }
    begin = time.monotonic()
    with pytest.raises(
        (ArgumentError, DescriptionError), match=r"are read|most that is read|not a .npz file"
    ):
        readers[suffix](path)
    assert time.monotonic() - begin < 2.0


def test_bounds_are_far_beyond_what_robots_need() -> None:
    assert min(MAX_BINARY_BYTES, MAX_TABLE, MAX_STATE) >= 2**28
    assert 100 * max(path.stat().st_size for path in (ROOT / "models/scenes").glob("*.toml")) <= MAX_TOML
    assert MAX_CELLS >= 10**7
    assert MAX_KEY_PARTS >= 10


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[" + "[]," * MAX_LISTS_AND_TABLES + "[]]", "more than 5,000,000 lists"),
        ("[" * 10**5, "nested too deeply"),
        ('{"a": ' * 10**5, "nested too deeply"),
        ("[1,", "Expecting value"),
    ],
)
def test_json_of_too_many_or_too_deep_parts_is_refused(text: str, message: str) -> None:
    for given in (text, text.encode()):
        with pytest.raises(ValueError, match=message):
            parse_json(given)


def test_json_of_millions_of_numbers_is_read() -> None:
    assert len(parse_json("[" + "0.5," * 10**6 + "1]")) == 10**6 + 1


KEY = ".".join(["a"] * 20_000)


@pytest.mark.parametrize(
    "text",
    [
        f"{KEY} = 1\n{KEY} = 2\n",
        f"[{KEY}]\n",
        f"[[{KEY}]]\n",
        f"x = {{ {KEY} = 1 }}\n",
        " . ".join(['"a"'] * 20_000) + " = 1\n",
        "\t.'b'.".join(["a"] * 20_000) + " = 1\n",
    ],
)
def test_a_key_of_many_parts_is_refused(text: str, tmp_path: Path) -> None:
    """Python's reader of TOML takes time with the square of their number."""
    path = tmp_path / "s.toml"
    path.write_text('schema = "dynx.scene/1"\n' + text)
    begin = time.monotonic()
    with pytest.raises(ArgumentError, match="line 2 has more than 16 parts"):
        read_scene(path)
    assert time.monotonic() - begin < 2.0


def test_text_with_many_dots_is_no_key(tmp_path: Path) -> None:
    path = tmp_path / "s.toml"
    dots = "... 1.0 2.5 -.5.. see a.b.c, " * 30
    path.write_text(f'schema = "dynx.scene/1"\nname = "{dots}"\n')
    assert read_scene(path).name == dots


def test_an_obj_file_of_one_endless_polygon_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n\n\nf" + " 1" * 10**6)
    with pytest.raises(DescriptionError, match="line 6: it has more than 1,048,576 bytes"):
        _ = Mesh(str(path)).triangles


def test_an_obj_file_with_any_line_ends_and_blanks_is_read(tmp_path: Path) -> None:
    path = tmp_path / "m.obj"
    path.write_bytes(
        b"\r\n \t v 0 0 0\rv 1 0\\\n 0\r\n\n  v\t0 1 0\nvn 0 0 1\nvt 0 0\nfoo\n f 1/1/1 2//2 \\\r\n 3\n"
    )
    vertices, faces = Mesh(str(path)).triangles
    np.testing.assert_array_equal(vertices, np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]]))
    np.testing.assert_array_equal(faces, [[0, 1, 2]])
    path.write_bytes(b"v 0 0 0\n\nv")
    with pytest.raises(DescriptionError, match="line 3: a vertex has 0 numbers"):
        _ = Mesh(str(path)).triangles


def test_a_table_of_too_many_cells_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_bytes(b"t,q:joint\n" + b"," * MAX_CELLS)
    with pytest.raises(ArgumentError, match="more than 20,000,000 cells"):
        dynx.Rollout.load(path, dynx.load("pendulum"))


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_expands_beyond_bounds_is_refused(compression: str, tmp_path: Path) -> None:
    from tests.security.surfaces.recording import chunk, recording

    compress = pytest.importorskip({"zstd": "zstandard", "lz4": "lz4.frame"}[compression]).compress
    path = tmp_path / "r.mcap"
    for size in (100, 10**9):
        path.write_bytes(recording(chunk(compress(bytes(10**8)), compression, size)))
        with pytest.raises(ArgumentError, match="a chunk has more than 33,554,432 bytes"):
            dynx.Rollout.load(path)


def test_a_recording_compressed_by_others_is_read(tmp_path: Path) -> None:
    from mcap.writer import CompressionType

    from tests.security.surfaces.arrays import rollout
    from tests.security.surfaces.recording import copied

    for compression in (CompressionType.LZ4, CompressionType.ZSTD, CompressionType.NONE):
        path = tmp_path / f"{compression.name}.mcap"
        path.write_bytes(copied(compression=compression))
        np.testing.assert_array_equal(dynx.Rollout.load(path).q, rollout().q)


@pytest.mark.parametrize("name", ["a;=1+1", "a\t@x", "a; -1+1"])
def test_a_name_that_spreadsheets_compute_is_refused_in_a_table(name: str) -> None:
    from dynx.sim.record.csv_file import _quoted

    with pytest.raises(ArgumentError, match="a part that spreadsheets compute"):
        _quoted(f"q:{name}")
    assert _quoted("q:a;b-c=d") == "q:a;b-c=d"


def test_what_cannot_be_opened_is_named(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=re.escape("is a directory; wanted a file")), named_file(tmp_path):
        pass
    with pytest.raises(ArgumentError, match="cannot be read: No such file"), named_file(tmp_path / "none"):
        pass


READERS = re.compile(r"(?<![\w.])(?<!def )open\(|\.open\(\"?r|zipfile\.ZipFile\(path|np\.load\(|\bio\.open\(")

OPENS = {
    "model/package_search.py": "the manifest of a package, which is a file and no link",
    "training/records.py": "a line is added to the curve of a run, whose links are refused",
    "files/writing.py": "a pipe that has a reader",
}
"""Modules that open a file by a name in another way than `dynx.files.reading`, and why."""


def test_files_are_opened_by_one_room() -> None:
    """A file that a user names may be a device or a pipe, which `open` would wait for."""
    found = {
        path.relative_to(ROOT / "dynx").as_posix()
        for path in (ROOT / "dynx").rglob("*.py")
        if READERS.search(path.read_text(encoding="utf-8"))
    }
    assert found == set(OPENS)


def test_a_file_of_nothing_but_faults_is_not_repaired() -> None:
    """Each takes a hundredth of a millisecond to repair: a file of 64 MiB a minute."""
    from dynx.model.xml.reading import MAX_REPAIRS, repaired

    def text(count: int) -> str:
        return f"<robot>{'&' * count}<link/></robot>".replace("&", "<!-- -- -->")

    assert repaired(text(100)) is not None
    begin = time.monotonic()
    assert repaired(text(5 * MAX_REPAIRS)) is None
    assert time.monotonic() - begin < 10.0


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no pipes")
def test_xacro_does_not_wait_for_a_pipe(tmp_path: Path) -> None:
    pytest.importorskip("xacro")
    os.mkfifo(tmp_path / "p.xacro")
    path = tmp_path / "r.xacro"
    path.write_text(
        '<robot xmlns:xacro="http://ros.org/wiki/xacro" name="r"><xacro:include filename="p.xacro"/></robot>'
    )
    with pytest.raises(DescriptionError, match="is a FIFO; wanted a regular file"):
        dynx.load(path)


def test_the_engine_that_a_world_names_is_no_class_and_its_memory_no_overflow(tmp_path: Path) -> None:
    from tests.security.surfaces.world_state import changed

    box = make_box(tmp_path / "box")
    changed(box, lambda header: header.update(memory=[[["0x1p+9999"]]]))
    with pytest.raises(ArgumentError, match="cannot be read as a world: hexadecimal value too large"):
        World.read(box.here / "w.world")


def test_arrays_that_bzip2_and_lzma_compressed_are_not_expanded(tmp_path: Path) -> None:
    """`zipfile` expands them in one piece, whatever size they state."""
    for method in (zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_DEFLATED):
        with zipfile.ZipFile(tmp_path / "r.npz", "w", method) as archive:
            archive.writestr("q.npy", bytes(10**6))
        with pytest.raises(ArgumentError, match="cannot be read as"):
            dynx.Rollout.load(tmp_path / "r.npz")


def test_a_scene_has_at_most_some_thousand_sensors() -> None:
    body = box("b", (0.1, 0.1, 0.1), mass=1.0)
    sensors = tuple(ContactSensor(f"s{k}", "b") for k in range(MAX_SENSORS + 1))
    with pytest.raises(ArgumentError, match="sensors has 10001 sensors; wanted at most 10000"):
        Scene("s", bodies=(body,), sensors=sensors)


def test_pairs_that_are_named_again_and_again_are_looked_up_once() -> None:
    bodies = [box(name, (0.1, 0.1, 0.1), mass=1.0) for name in "abc"]
    scene = Scene("s", bodies=bodies, groups={"g": ("a", "b")}, ignored=[("g", "c"), ("a", "b")] * 10**4)
    assert len(scene.collision_filter._ignored) == 2
    assert not scene.collision_filter.pairs(["a", "b", "c"]).any()
    assert not scene.may_collide("c", "b")
    assert Scene("s", bodies=bodies, ignored=[("a", "b")]).may_collide("a", "c")


def test_what_numpy_says_of_a_long_header_is_shortened(tmp_path: Path) -> None:
    header = b"{'descr': '<f8', 'fortran_order': False, 'shape': " + b"(" * 4000 + b")" * 4000 + b"}\n"
    with zipfile.ZipFile(tmp_path / "r.npz", "w") as archive:
        archive.writestr("q.npy", b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header)
    with pytest.raises(ArgumentError, match="cannot be read as") as error:
        dynx.Rollout.load(tmp_path / "r.npz")
    assert len(str(error.value)) < 1000
