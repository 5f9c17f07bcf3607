"""Names and files that somebody made to run scripts or to reach a server: page and export show them."""

from __future__ import annotations

import json
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from xml.sax.saxutils import quoteattr

import pytest

import dynx
from dynx.errors import DescriptionError
from dynx.viewer import Viewer, view
from tests.security.surfaces.page import MARK
from tests.viewer.conftest import Opened, OpenPage, connected
from tests.viewer.hostile_pages import VIEWED_FILES, faults_of_files, faults_of_page

NAMES = (
    "<script>window.ran=1</script>",
    "</script><script>window.ran=1</script>",
    "<img src=x onerror=window.ran=1>",
    '"><svg onload=window.ran=1>',
    "' autofocus onfocus=window.ran=1 x='",
    "--><script>window.ran=1</script><!--",
    "<iframe srcdoc='<script>parent.ran=1</script>'></iframe>",
    "[click](javascript:window.ran=1)",
    "![x](https://evil.test/x.png)",
    "<a href='javascript:window.ran=1'>a</a>",
    "${window.ran=1}",
    "{window.ran=1}",
    "\\u003cscript\\u003ewindow.ran=1\\u003c/script\\u003e",
    "\\",
    "\\'-(window.ran=1)-\\'",
    "javascript:window.ran=1",
    "a\u202egnp.x\u200b\ufeff",
    "<style>*{background:url(https://evil.test/s)}</style>",
    "<link rel=stylesheet href=//evil.test/l><meta http-equiv=refresh content='0;url=//evil.test'>",
    "&lt;script&gt;window.ran=1&lt;/script&gt;",
    "constructor",
    "__proto__",
)
"""Names of links, joints, materials, texts and controls."""

SEPARATORS = ("a\u2028window.ran=1", "a\u2029window.ran=1")
"""Texts that no robot can have for a name."""

SVG = b'<svg xmlns="http://www.w3.org/2000/svg" onload="window.ran=1"><script>window.ran=1</script></svg>'


def png(width: int, height: int, content: bytes = b"\0\0\0\0") -> bytes:
    """Return a PNG file that says that it has a size, of colours that fill a part of it."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + head + chunk(b"IDAT", zlib.compress(content)) + chunk(b"IEND", b"")


FILES: dict[str, bytes] = {
    "drawing.svg": SVG,
    "drawing.png": SVG,
    "huge.png": png(100_000, 100_000),
    "short.png": png(64, 64)[:40],
    "torn.png": png(64, 64),
    "page.png": b"<html><script>window.ran=1</script></html>",
    "<img src=x onerror=window.ran=1>.png": png(1, 1),
    "x.png' onerror='window.ran=1": png(1, 1),
}
"""Images, by their names."""

ADDRESSES = (
    "javascript:window.ran=1",
    "https://evil.test/x.png",
    "//evil.test/x.png",
    "data:text/html,<script>window.ran=1</script>",
    f"data:image/svg+xml,{SVG.decode()}",
)
"""Images that a file names and that are no files."""

TRIANGLE = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"


def gltf(image: str) -> str:
    """Return a triangle with an image as glTF."""
    numbers = struct.pack("<15f3I", 0, 0, 0, 0.1, 0, 0, 0, 0.1, 0, 0, 0, 1, 0, 0, 1, 0, 1, 2)
    views = [(0, 36), (36, 24), (60, 12)]
    return json.dumps(
        {
            "asset": {"version": "2.0", "generator": NAMES[1]},
            "scene": 0,
            "scenes": [{"nodes": [0], "name": NAMES[0]}],
            "nodes": [{"mesh": 0, "name": NAMES[2]}],
            "meshes": [
                {
                    "name": NAMES[3],
                    "primitives": [
                        {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
                    ],
                }
            ],
            "materials": [{"name": NAMES[4], "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
            "textures": [{"source": 0}],
            "images": [{"uri": image, "name": NAMES[5]}],
            "buffers": [
                {"byteLength": 72, "uri": f"data:application/octet-stream;base64,{_base64(numbers)}"}
            ],
            "bufferViews": [{"buffer": 0, "byteOffset": start, "byteLength": size} for start, size in views],
            "accessors": [
                {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}
                | {"min": [0, 0, 0], "max": [0.1, 0.1, 0]},
                {"bufferView": 1, "componentType": 5126, "count": 3, "type": "VEC2"},
                {"bufferView": 2, "componentType": 5125, "count": 3, "type": "SCALAR"},
            ],
        }
    )


def _base64(data: bytes) -> str:
    import base64

    return base64.b64encode(data).decode()


def hostile_robot(folder: Path) -> Path:
    """Write a robot of hostile names, meshes and images; return its description."""
    for name, content in FILES.items():
        (folder / name).write_bytes(content)
    links, joints = [], []
    images = [*FILES, *ADDRESSES]
    for number, name in enumerate(NAMES):
        image = images[number % len(images)]
        kind = ("box", "obj", "gltf")[number % 3]
        shape = '<box size="0.1 0.1 0.1"/>'
        if kind != "box":
            # The name of a mesh is hostile, too.
            file = f"<img src=x onerror=window.ran=1>{number}.{kind}"
            shape = f"<mesh filename={quoteattr(file)}/>"
            text = gltf(image)
            if kind == "obj":
                library = f"{number}.mtl"
                (folder / library).write_text(f"newmtl {name}\nKd 1 0 0\nmap_Kd {image}\n")
                text = f"mtllib {library}\n{TRIANGLE}usemtl {name}\nf 1/1 2/2 3/3\n"
            (folder / file).write_text(text)
        links.append(
            f'<link name={quoteattr(name)}><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
            'ixy="0" ixz="0" iyz="0"/></inertial><visual><geometry>'
            f"{shape}</geometry><material name={quoteattr(name)}><texture filename={quoteattr(image)}/>"
            "</material></visual></link>"
        )
        if number:
            joints.append(
                f'<joint name={quoteattr(name)} type="revolute"><parent link={quoteattr(NAMES[number - 1])}/>'
                f'<child link={quoteattr(name)}/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>'
                '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
            )
    path = folder / "robot.urdf"
    path.write_text(f"<robot name={quoteattr(NAMES[1])}>{''.join(links + joints)}</robot>", encoding="utf-8")
    return path


def add_hostile_controls(viewer: Viewer) -> None:
    """Write hostile names on the picture, and give them to controls."""
    for number, name in enumerate((*NAMES, *SEPARATORS)):
        viewer.text(name, (0.0, 0.5, 0.1 * number))
    viewer.slider(NAMES[1], 0.0, 1.0)
    viewer.dropdown(NAMES[2], (*NAMES, *SEPARATORS))
    viewer.button(NAMES[3], lambda: None)


def asked_elsewhere(page: Opened, address: str) -> list[str]:
    """Return what a page asked for of others than the server of its address."""
    own = urlsplit(address)
    return [
        each
        for each in page.requests
        if urlsplit(each).scheme not in ("data", "blob", "about")
        and (urlsplit(each).scheme, urlsplit(each).netloc) != (own.scheme, own.netloc)
    ]


def check_harmless(page: Opened, address: str) -> None:
    """Check that nothing hostile ran, that nothing was asked for elsewhere, and that the page is content."""
    for frame in page.page.frames:
        assert frame.evaluate("window.ran") is None
    assert page.page.evaluate("({}).ran") is None
    assert asked_elsewhere(page, address) == []
    assert page.errors == []


@pytest.fixture
def watched(open_page: OpenPage) -> Callable[[str], Opened]:
    """Open an address, and let no dialog open."""

    def opened(address: str) -> Opened:
        page = open_page()
        page.page.on("dialog", lambda dialog: page.errors.append(f"a dialog: {dialog.message}"))
        page.go_to(address)
        return page

    return opened


def test_hostile_names_and_files_are_shown_and_not_run(
    watched: Callable[[str], Opened], tmp_path: Path
) -> None:
    model = dynx.load(hostile_robot(tmp_path))
    assert [link.name for link in model.links] == list(NAMES)
    exported = tmp_path / "page.html"
    with view(model, whole_meshes=False) as viewer:
        assert any("evil.test" in note or "no file" in note for note in viewer.notes)
        add_hostile_controls(viewer)
        viewer.view._marks.show("names", True)
        viewer.view._marks.show("frames", True)
        viewer.follow(NAMES[2])
        viewer.set_opacity(0.5, NAMES[3])
        page = watched(viewer.url)
        connected(viewer)
        page.page.wait_for_timeout(1000.0)
        hover_everywhere(page)
        check_harmless(page, viewer.url)
        viewer.export(exported)
    recorded = watched(exported.as_uri())
    recorded.page.wait_for_timeout(1000.0)
    hover_everywhere(recorded)
    check_harmless(recorded, exported.as_uri())


@pytest.mark.parametrize("name", SEPARATORS)
def test_a_name_that_breaks_lines_of_a_script_is_refused(name: str) -> None:
    with pytest.raises(DescriptionError, match="control character U"):
        dynx.load(f"<robot name='a'><link name={quoteattr(name)}/></robot>")


def hover_everywhere(page: Opened) -> None:
    """Move the pointer up the middle of the picture, so that the page writes names of parts."""
    box: Any = page.page.locator("canvas[data-engine]").bounding_box()
    for share in (0.2, 0.4, 0.5, 0.6, 0.8):
        page.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + share * box["height"])
        page.page.wait_for_timeout(100.0)


SAMPLED = 5
"""One of so many hostile files is opened here; all of them by ``python -m tests.viewer.hostile_pages``."""


@pytest.mark.skipif(sys.platform != "linux", reason="the attacks need Linux")
def test_pages_of_hostile_files_open_without_a_network(browser: Any, tmp_path: Path) -> None:
    assert len(VIEWED_FILES) >= 20
    found = faults_of_files(browser, VIEWED_FILES[::SAMPLED], tmp_path)
    assert {name: wrong for name, wrong in found.items() if wrong} == {}
    assert len(list(tmp_path.glob("*/here/out.html"))) >= 4


def test_what_a_hostile_page_does_is_found(browser: Any, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(
        f"<canvas data-engine='x'></canvas><script>{MARK}()</script><img src='https://192.0.2.1/x.png'>"
    )
    found = " ".join(faults_of_page(browser, page))
    assert "ran a script" in found
    assert "asked for https://192.0.2.1/x.png" in found
