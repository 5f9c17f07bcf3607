"""Meshes made to take for ever, or to break their reader: each is read, or refused, in bounded time."""

from __future__ import annotations

import struct
import time
from collections.abc import Callable
from pathlib import Path
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.geometry.formats import collada
from dynx.rules.geometry import mesh_box
from tests.rules.geometry.test_meshes import FACET, ascii_stl, binary_stl, box_of, dae, obj

SECONDS = 20.0
"""Limit for a file of a megabyte [s of processor time]: a linear reader takes 1, a quadratic one hours."""

LENGTH = 2**20


def nested_instances(doublings: int) -> bytes:
    """Return a COLLADA file of nodes that each place the next one twice: 2^doublings meshes."""
    nodes = "".join(
        f'<node id="n{k}"><instance_node url="#n{k + 1}"/><instance_node url="#n{k + 1}"/></node>'
        for k in range(doublings)
    )
    last = f'<node id="n{doublings}"><instance_geometry url="#part"/></node>'
    library = f"<library_nodes>{nodes}{last}</library_nodes>"
    text = dae(FACET, node='<instance_node url="#n0"/>').decode()
    return text.replace("<library_visual_scenes>", f"{library}<library_visual_scenes>").encode()


def many_inside(count: int) -> str:
    """Elements within elements."""
    return "<extra>" * count + "</extra>" * count


HOSTILE: dict[str, bytes] = {
    "line_feeds.stl": b"solid" + b"\n" * LENGTH,
    "blanks.stl": b"solid " + b" " * LENGTH,
    "vertices_without_end.stl": b"solid " + b"vertex " * (LENGTH // 7),
    "one_long_vertex.stl": b"solid\nvertex" + b" " * LENGTH + b"1",
    "tabs.stl": b"solid" + b"\n\t\t\t" * (LENGTH // 4),
    "carriage_returns.stl": b"solid" + b"\r" * LENGTH,
    "huge_count.stl": bytes(80) + struct.pack("<I", 2**32 - 1) + bytes(50),
    "no_number.stl": b"solid\nvertex " + b"1" * LENGTH + b"x 0 0\n",
    "endless_number.stl": b"solid\nvertex " + b"1" * LENGTH + b" 0 0\n",
    "blanks.obj": b"v" + b" " * LENGTH,
    "words.obj": b"v " + b"1" * LENGTH,
    "two_words.obj": b"v " + b"1" * LENGTH + b" " + b"1" * LENGTH,
    "lines_of_blanks.obj": b" \n" * (LENGTH // 2),
    "nul.obj": b"v 1 2\0 3\n" * 1000,
    "nested_instances.dae": nested_instances(45),
    "deep.dae": dae(FACET, node=many_inside(100_000)),
    "itself.dae": dae(FACET, node='<node id="own"><instance_node url="#own"/></node>'),
    "stride.dae": dae(FACET).replace(b'stride="3"', b'stride="' + b"9" * 30 + b'"'),
    "offset.dae": dae(FACET).replace(b'stride="3"', b'stride="3" offset="-9999999"'),
    "long_stride.dae": dae(FACET).replace(b'stride="3"', b'stride="' + b"9" * 9999 + b'"'),
    "entities.dae": b'<!DOCTYPE a [<!ENTITY a "aaaaaaaa">]>' + dae(FACET),
    "encoding.dae": b'<?xml version="1.0" encoding="idna"?><COLLADA/>',
    "latin.dae": dae(FACET).replace(b"<up_axis>Z_UP", b"<up_axis>\xfcZ_UP"),
    "rotation.dae": dae(FACET, node="<rotate>0 0 0 90</rotate>"),
    "infinity.dae": dae(FACET, node="<translate>1e999 0 0</translate>"),
    "two_numbers.dae": dae(FACET, node="<scale>1 2</scale>"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_mesh_is_read_or_refused_in_bounded_time(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(HOSTILE[name])
    started = time.process_time()
    box = mesh_box(path)
    assert time.process_time() - started < SECONDS
    assert box is None or name == "latin.dae"


def test_nested_instances_are_followed_up_to_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    few = tmp_path / "few.dae"
    few.write_bytes(nested_instances(5))
    assert mesh_box(few) == box_of(FACET)
    for limit in ("MAX_NODES", "MAX_POINTS"):
        with monkeypatch.context() as changed:
            changed.setattr(collada, limit, 90 if limit == "MAX_POINTS" else 60)
            assert collada.collada_points(nested_instances(5)) is None


def test_a_source_that_many_geometries_share_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    positions = Mock(wraps=collada._source_values)
    monkeypatch.setattr(collada, "_source_values", positions)
    text = dae(FACET).decode()
    again = text.replace("<instance_geometry", '<instance_geometry url="#part"/>' * 50 + "<instance_geometry")
    found = collada.collada_points(again.encode())
    assert found is not None
    assert len(found) == 51 * 3
    assert positions.call_count == 1


@pytest.mark.parametrize(
    ("suffix", "write"), [("stl", binary_stl), ("stl", ascii_stl), ("obj", obj), ("dae", dae)]
)
@given(data=st.data())
def test_a_damaged_mesh_is_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, suffix: str, write: Callable[..., bytes]
) -> None:
    content = bytearray(write(FACET))
    for _ in range(data.draw(st.integers(1, 8))):
        at = data.draw(st.integers(0, len(content) - 1))
        match data.draw(st.sampled_from(["change", "delete", "repeat"])):
            case "change":
                content[at] = data.draw(st.integers(0, 255))
            case "delete":
                del content[at : at + data.draw(st.integers(1, 20))]
                content = content or bytearray(b" ")
            case _:
                content[at:at] = content[at : at + 40] * data.draw(st.integers(1, 5))
    path = tmp_path_factory.mktemp("damaged") / f"mesh.{suffix}"
    path.write_bytes(content)
    box = mesh_box(path)
    assert box is None or all(low <= high for low, high in zip(*box, strict=True))
