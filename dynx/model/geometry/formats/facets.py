"""Readers of meshes that list facets: STL, in text and binary, and OBJ."""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DynxError, shown
from dynx.model.geometry.formats.surface import MAX_TRIANGLES, FileMaterial, FileSurface, ImageFile
from dynx.spatial.scalar import Floats

# Triangles of STL files, binary or text.


STL_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
"""A facet of a binary STL file."""

STL_HEAD = 84
"""Length of the head of a binary STL file [bytes], whose last four hold the number of facets."""

MAX_FACET_COLOURS = 64
"""Largest number of colours of facets that are materials; more are colours of corners."""

# Each line is matched in time proportional to its length: a pattern must not run across lines.
STL_VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE | re.IGNORECASE)
_END = re.compile(rb"^[ \t]*endloop\b", re.MULTILINE | re.IGNORECASE)


def stl_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the corners (3 m, 3) of the facets, and the numbers of each facet's corners (m, 3).

    A binary file is known by its length, since some begin with "solid" too. Raises ValueError for a damaged
    file.
    """
    if len(data) >= STL_HEAD:
        count = int.from_bytes(data[80:84], "little")
        length = STL_HEAD + STL_FACET.itemsize * count
        is_text = data.lstrip()[:5].lower() == b"solid"
        if len(data) == length or (len(data) > length and count > 0 and not is_text):
            corners = np.frombuffer(data, STL_FACET, count, STL_HEAD)["corners"]
            return _numbered(corners.reshape(-1, 3).astype(np.float64))
        if not is_text:
            raise ValueError(
                f"it is truncated: {count} triangles take {length} bytes, and it has {len(data)}"
                if count
                else "it has no triangle"
            )
    elif data.lstrip()[:5].lower() != b"solid":
        raise ValueError(f"it is truncated: the head of a binary file takes 84 bytes, and it has {len(data)}")
    lines = data.replace(b"\r", b"\n")
    found = (float(number) for match in STL_VERTEX.finditer(lines) for number in match.groups())
    vertices = np.fromiter(found, np.float64).reshape(-1, 3)
    loops = sum(1 for _ in _END.finditer(lines))
    if len(vertices) != 3 * loops:
        raise ValueError(f"it is truncated: {len(vertices)} corners in {loops} closed loops of three")
    return _numbered(vertices)


def _numbered(corners: Floats) -> tuple[Floats, NDArray[np.intp]]:
    return corners, np.arange(len(corners), dtype=np.intp).reshape(-1, 3)


def stl_surface(data: bytes) -> FileSurface:
    """Return the facets with the colours that some programs write into the attributes of a binary file.

    VisCAM and SolidView mark an attribute with a colour by its highest bit; Materialise, whose files have
    "COLOR=" and a colour for the whole in their head, by the absence of that bit. Facets are flat. Raises
    ValueError for a damaged file.
    """
    vertices, faces = stl_triangles(data)
    if len(data) < STL_HEAD + STL_FACET.itemsize * len(faces) or data[:6].lower() == b"solid ":
        return FileSurface(vertices, faces)
    attributes = np.frombuffer(data, STL_FACET, len(faces), STL_HEAD)["attribute"].astype(np.intp)
    # Programs that know no colours of facets write that head and empty attributes.
    if not attributes.any():
        return FileSurface(vertices, faces)
    whole = data[:80].partition(b"COLOR=")[2][:4]
    fives = np.stack([attributes >> shift & 31 for shift in (10, 5, 0)], axis=1) / 31.0
    marked = attributes >> 15 == 1
    if len(whole) == 4:
        red_first = fives[:, ::-1]
        colours = np.where(marked[:, None], np.frombuffer(whole, np.uint8)[:3] / 255.0, red_first)
    elif marked.any():
        colours = np.where(marked[:, None], fives, np.nan)
    else:
        return FileSurface(vertices, faces)
    distinct, number = np.unique(np.nan_to_num(colours, nan=-1.0), axis=0, return_inverse=True)
    if len(distinct) > MAX_FACET_COLOURS:
        return FileSurface(vertices, faces, colours=np.repeat(colours[:, None], 3, axis=1))
    materials = tuple(
        FileMaterial(None if red < 0.0 else (red, green, blue, 1.0)) for red, green, blue in distinct.tolist()
    )
    return FileSurface(vertices, faces, materials=materials, material_of=number.reshape(-1))


# Triangles of Wavefront OBJ files, and what they look like.


LONGEST_LINE = 2**20
"""Largest length of a line of an OBJ file, such as a polygon of 100,000 corners [bytes]."""

MAX_VERTICES = 6_000_000
"""Largest number of vertices of an OBJ file."""

MAX_LIBRARIES = 16
"""Largest number of files of materials of an OBJ file that are read."""

MAX_LIBRARY = 2**22
"""Largest size of a file of materials [bytes]."""

ReadBeside = Callable[[str], bytes]

_LINE_END = re.compile(rb"\r\n|[\r\n]")
_ANY_LINE = rb"(?<![^\r\n])[ \t\f\v]*(?:%s)(?:[ \t\f\v][^\r\n]*|(?=[\r\n]|\Z))"
_VERTEX_FACE_OR_OBJECT = re.compile(_ANY_LINE % rb"[vfog]")
_DRAWN_LINE = re.compile(_ANY_LINE % rb"[vfogs]|v[tn]|usemtl|mtllib")


def obj_triangles(data: bytes) -> tuple[Floats, NDArray[np.intp]]:
    """Return the vertices (n, 3) and triangles (m, 3) of all objects; polygons are divided into fans.

    Raises ValueError, with the line, for a damaged file.
    """
    found = _obj(data)
    return found.vertices, found.faces


def obj_objects(data: bytes) -> list[NDArray[np.intp]]:
    """Return the triangles (m, 3) of each object and group that has some, in the order of the file.

    Raises ValueError, with the line, for a damaged file.
    """
    found = _obj(data)
    return [each for each in np.split(found.faces, found.objects) if len(each)]


def obj_surface(data: bytes, read_beside: ReadBeside) -> FileSurface:
    """Return the triangles with their normals, images and colours.

    A material gives its diffuse colour (``Kd``) with its opacity (``d``, or 1 - ``Tr``), or an image
    (``map_Kd``); colours after the coordinates of vertices come before those of materials. Without normals
    (``vn``) the triangles of a smoothing group (``s 1``) have the mean normals of their corners, and others
    are flat. `read_beside` returns the bytes of a file of materials. Raises ValueError, with the line, for a
    damaged file.
    """
    found = _obj(data, drawn=True)
    notes: list[str] = []
    known: dict[str, FileMaterial] = {}
    for library in found.libraries:
        known |= dict(_materials(_text_beside(library, read_beside, notes)))
    numbers = {"": 0} | {name: k for k, name in enumerate(known, 1)}
    material_of = np.zeros(len(found.faces), np.intp)
    for (start, name), (end, _) in pairwise([*found.materials, (len(found.faces), "")]):
        material_of[start:end] = numbers.get(name, 0)
        if name not in numbers and not notes:
            notes.append(f"material {shown(name)} is in none of its files of materials")
    uv = _corners_of(found.places, found.place_of)
    normals = _corners_of(found.normals, found.normal_of)
    smooth = np.zeros(len(found.faces), np.intp)
    for (start, group), (end, _) in pairwise([*found.smoothing, (len(found.faces), 0)]):
        smooth[start:end] = group
    if smooth.any() and (normals is None or np.isnan(normals).any()):
        normals = _with_means(found.vertices, found.faces, smooth, normals)
    colours = None
    if len(found.colours) == len(found.vertices):
        colours = found.colours[found.faces]
    materials = (FileMaterial(), *known.values())
    return FileSurface(
        found.vertices, found.faces, normals, uv, colours, materials, material_of, tuple(notes)
    )


def _text_beside(name: str, read_beside: ReadBeside, notes: list[str]) -> str:
    """Return the text of a file of materials; nothing, with a note, for one that is not read."""
    try:
        content = read_beside(name)
        if len(content) > MAX_LIBRARY:
            raise ValueError(f"it has more than {MAX_LIBRARY:,} bytes")
        return content.decode("utf-8", "replace")
    except (DynxError, ValueError) as error:
        notes.append(f"materials {shown(name, 200)} are not read: {error}")
        return ""


def _corners_of(values: Floats, number_of: NDArray[np.intp]) -> Floats | None:
    """Return the values (m, 3, d) at the corners of triangles by their numbers (m, 3); NaN for a number that
    is not among them, and None if all are."""
    known = (number_of >= 0) & (number_of < len(values))
    if not known.any():
        return None
    found = np.full((*number_of.shape, values.shape[1]), np.nan)
    found[known] = values[number_of[known]]
    return found


def _with_means(
    vertices: Floats, faces: NDArray[np.intp], smooth: NDArray[np.intp], normals: Floats | None
) -> Floats:
    """Return normals (m, 3, 3) where corners of smoothing groups (m,) without one have the mean of the
    normals of their group at their vertex."""
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    flat = np.cross(b - a, c - a)
    _, group = np.unique(smooth, return_inverse=True)
    _, number = np.unique(group.reshape(-1, 1) * len(vertices) + faces, return_inverse=True)
    number = number.reshape(-1)
    means = np.stack([np.bincount(number, np.repeat(each, 3)) for each in flat.T], axis=1)
    found = np.where((smooth > 0)[:, None, None], means[number].reshape(-1, 3, 3), np.nan)
    return found if normals is None else np.where(np.isnan(normals), found, normals)


_OPTIONS_OF_MAPS = {"-mm": 2, "-o": 3, "-s": 3, "-t": 3}
"""Largest numbers of values of options of images; others have one."""


def _materials(text: str) -> Iterator[tuple[str, FileMaterial]]:
    """Yield the name and the content of each material of an MTL file."""
    lines = [words for line in text.replace("\\\n", " ").splitlines() if (words := line.split())]
    starts = [k for k, words in enumerate(lines) if words[0] == "newmtl"]
    for start, end in pairwise([*starts, len(lines)]):
        given = {words[0]: words[1:] for words in lines[start + 1 : end]}
        rgb, opacity, clear = (_shares(given.get(key, [])) for key in ("Kd", "d", "Tr"))
        alpha = opacity[0] if opacity else 1.0 - clear[0] if clear else 1.0
        rgba = (rgb[0], rgb[1], rgb[2], alpha) if len(rgb) == 3 else None
        image = _image_of(given["map_Kd"]) if "map_Kd" in given else None
        yield " ".join(lines[start][1:]), FileMaterial(rgba, image, (1.0, 1.0, 1.0, alpha))


def _shares(words: list[str]) -> list[float]:
    """Return numbers, clamped to the range from 0 to 1; nothing where a word is none."""
    try:
        numbers = [float(word) for word in words[:3]]
    except ValueError:
        return []
    return [min(max(number, 0.0), 1.0) for number in numbers] if np.isfinite(numbers).all() else []


def _image_of(words: list[str]) -> ImageFile | None:
    clamped = False
    while len(words) > 1 and words[0].startswith("-"):
        most, taken = _OPTIONS_OF_MAPS.get(words[0], 1), 1
        clamped = clamped or words[:2] == ["-clamp", "on"]
        while taken <= most and taken < len(words) - 1 and (most == 1 or _shares([words[taken]])):
            taken += 1
        words = words[taken:]
    return ImageFile(" ".join(words).replace("\\", "/"), None, (not clamped, not clamped)) if words else None


class _Obj(NamedTuple):
    """What an OBJ file lists."""

    vertices: Floats
    faces: NDArray[np.intp]
    objects: list[int]
    """Number of triangles before each line that begins an object or a group."""
    colours: Floats
    """Of the vertices (n, 3), or fewer than there are."""
    places: Floats
    normals: Floats
    place_of: NDArray[np.intp]
    """Numbers (m, 3) of the places in an image, and of the normals; -1 for none."""
    normal_of: NDArray[np.intp]
    smoothing: list[tuple[int, int]]
    """Number of triangles before each line of a smoothing group, and the group; 0 for none."""
    materials: list[tuple[int, str]]
    """Number of triangles before each line that uses a material, and its name."""
    libraries: list[str]
    """Files of materials."""


def _obj(data: bytes, *, drawn: bool = False) -> _Obj:
    """Return what a file lists; what triangles look like is read if they are to be `drawn`."""
    # Lists of Python's numbers would take five times the memory.
    numbers, corners = array("d"), array("q")
    colours, places, normals, place_of, normal_of = array("d"), array("d"), array("d"), array("q"), array("q")
    text = data.replace(b"\\\r\n", b"  ").replace(b"\\\n", b" ")
    start, objects = 0, list[int]()
    smoothing, materials, libraries = list[tuple[int, int]](), list[tuple[int, str]](), list[str]()
    try:
        for match in (_DRAWN_LINE if drawn else _VERTEX_FACE_OR_OBJECT).finditer(text):
            start = match.start()
            if match.end() - start > LONGEST_LINE:
                raise ValueError(f"it has more than {LONGEST_LINE:,} bytes")
            words = match[0].split()
            key = words[0]
            if key == b"v":
                numbers.extend(_numbers(words, "vertex"))
                if drawn and len(words) == 7:
                    colours.extend(float(word) for word in words[4:])
            elif key == b"f":
                corners.extend(_fan(words[1:], len(numbers) // 3))
                if drawn:
                    place_of.extend(_others(words[1:], 1, len(places) // 2))
                    normal_of.extend(_others(words[1:], 2, len(normals) // 3))
            elif key == b"vt":
                places.extend(_numbers([*words[:3], b"0", b"0"], "place in an image")[:2])
            elif key == b"vn":
                normals.extend(_numbers(words, "normal"))
            elif key == b"s":
                smoothing.append(
                    (len(corners) // 3, int(words[1]) if words[1:] and words[1].isdigit() else 0)
                )
            elif key == b"usemtl":
                materials.append((len(corners) // 3, b" ".join(words[1:]).decode("utf-8", "replace")))
            elif key == b"mtllib":
                if len(libraries) < MAX_LIBRARIES:
                    libraries.append(b" ".join(words[1:]).decode("utf-8", "replace"))
            else:
                objects.append(len(corners) // 3)
            if max(len(numbers), len(places), len(normals)) > 3 * MAX_VERTICES:
                raise ValueError(f"the file has more than {MAX_VERTICES:,} vertices")
            if drawn and len(corners) > 3 * MAX_TRIANGLES:
                raise ValueError(f"the file has more than {MAX_TRIANGLES:,} triangles")
    except ValueError as error:
        line = 1 + sum(1 for _ in _LINE_END.finditer(text, 0, start))
        raise ValueError(f"line {line}: {error}") from None
    faces = np.array(corners, np.intp).reshape(-1, 3)
    vertices = np.array(numbers, np.float64).reshape(-1, 3)
    if faces.size and faces.max() >= len(vertices):
        raise ValueError(f"a face names vertex {faces.max() + 1}, and the file has {len(vertices)}")
    return _Obj(
        vertices,
        faces,
        objects,
        np.clip(np.array(colours, np.float64).reshape(-1, 3), 0.0, 1.0),
        np.array(places, np.float64).reshape(-1, 2),
        np.array(normals, np.float64).reshape(-1, 3),
        np.array(place_of, np.intp).reshape(-1, 3),
        np.array(normal_of, np.intp).reshape(-1, 3),
        smoothing,
        materials,
        libraries,
    )


def _numbers(words: list[bytes], what: str) -> tuple[float, float, float]:
    if len(words) < 4:
        raise ValueError(f"a {what} has {len(words) - 1} numbers; wanted three")
    return float(words[1]), float(words[2]), float(words[3])


def _fan(words: list[bytes], count: int) -> list[int]:
    """Return the corners of the triangles of a polygon; a negative number counts back from vertex `count`."""
    if len(words) < 3:
        raise ValueError(f"a face has {len(words)} corners; wanted three or more")
    rows = []
    for word in words:
        number = int(word.partition(b"/")[0])
        row = number - 1 if number > 0 else count + number
        if number == 0 or row < 0:
            raise ValueError(f"a face names vertex {shown(number)}; the first is 1, the last before it -1")
        rows.append(row)
    return _divided(rows)


def _others(words: list[bytes], field: int, count: int) -> list[int]:
    """Return the numbers after a slash at the corners of the triangles of a polygon, -1 for none; a negative
    number counts back from `count`."""
    rows = []
    for word in words:
        fields = word.split(b"/")
        given = fields[field] if field < len(fields) else b""
        number = int(given) if given.lstrip(b"-").isdigit() and len(given) < 18 else 0
        rows.append(number - 1 if number > 0 else max(count + number, -1) if number < 0 else -1)
    return _divided(rows)


def _divided(rows: list[int]) -> list[int]:
    """Return the corners of the triangles of a polygon, one after another."""
    if len(rows) == 3:
        return rows
    return [row for k in range(1, len(rows) - 1) for row in (rows[0], rows[k], rows[k + 1])]
