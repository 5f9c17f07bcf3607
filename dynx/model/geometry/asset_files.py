"""Files that go along with a description: its meshes and images, under paths beside it.

Files keep their places to each other, so that what a mesh names is found. A mesh in a format that the readers
of the description do not have is written as OBJ, with colours and images.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import PurePath

import numpy as np

from dynx.errors import DescriptionError, DynxError
from dynx.files.reading import read_file
from dynx.model.geometry.links import Geometry
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.mesh_reading import image_file, mesh_file

MAX_STL_TRIANGLES = 200_000
"""Largest number of triangles of an STL file that MuJoCo reads."""

LOOK_DIGITS = 5
"""Digits of normals and places in images of an OBJ file that is written."""


class AssetFiles:
    """Files of the meshes and images of a robot, by their paths beside the description."""

    def __init__(self, geometry: Geometry, folder: str, formats: Collection[str]) -> None:
        """`folder` is that beside the description, `formats` the suffixes of meshes that are copied."""
        self._folder, self._formats = folder, tuple(formats)
        self.files: dict[str, bytes] = {}
        """Contents by path, with / between folders."""
        self._places: dict[tuple[str, int | None] | Mesh, str] = {}
        self._taken: set[str] = set()
        self._common = _common_folder(_sources(geometry))

    def mesh_path(self, mesh: Mesh) -> str:
        """Return the path of a mesh in the description, and keep its files.

        Raises DescriptionError for one that cannot be read.
        """
        key = (mesh.file, mesh.part) if mesh.file else replace(mesh, scale=(1.0, 1.0, 1.0))
        if key not in self._places and not mesh.file:
            self._places[key] = self._write_obj(mesh)
        if key not in self._places:
            content = read_file(mesh.file)
            suffix = PurePath(mesh.file).suffix.lower()
            copied = mesh.part is None and suffix in self._formats and _is_copied(content, suffix)
            if copied:
                self._places[key] = self._keep(mesh.file, content)
                for other in _companions(mesh.file):
                    self._keep(other, read_file(other))
            else:
                self._places[key] = self._write_obj(mesh)
        return self._places[key]

    def image_path(self, path: str) -> str:
        """Return the path of an image in the description, and keep its file; raises DescriptionError."""
        return self._keep(path, read_file(path))

    def _keep(self, source: str, content: bytes) -> str:
        place = self._place(os.path.realpath(source))
        self.files[place] = content
        return place

    def _place(self, real: str) -> str:
        inside = os.path.relpath(real, self._common) if self._common else os.path.basename(real)
        return PurePath(self._folder, *PurePath(inside).parts).as_posix()

    def _write_obj(self, mesh: Mesh) -> str:
        source = os.path.realpath(mesh.file) if mesh.file else os.path.join(self._common, f"{mesh.name}.obj")
        place = PurePath(self._place(source))
        part = "" if mesh.part is None else f"_part{mesh.part}"
        stem, number = f"{place.stem}{part}", 2
        while place.with_name(f"{stem}.obj").as_posix() in {*self.files, *self._taken}:
            stem, number = f"{place.stem}{part}_{number}", number + 1
        for name, content in obj_files(mesh, stem):
            self.files[place.with_name(name).as_posix()] = content
        return place.with_name(f"{stem}.obj").as_posix()


def obj_files(mesh: Mesh, stem: str) -> Iterator[tuple[str, bytes]]:
    """Yield the names and contents of an OBJ file with the triangles of a mesh, before they are scaled, its
    file of materials, and its images."""
    lines, materials, images = [f"mtllib {stem}.mtl"], list[str](), dict[str, bytes]()
    count = {"v": 0, "vt": 0, "vn": 0}
    # Triangles before the first material have none.
    parts = sorted(enumerate(replace(mesh, scale=(1.0, 1.0, 1.0)).parts), key=lambda each: _is_plain(each[1]))
    for number, (part, look) in parts:
        surface = part.surface
        lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices.tolist()]
        columns = [(surface.faces.reshape(-1) + 1 + count["v"]).tolist()]
        count["v"] += len(surface.vertices)
        for tag, values in (("vt", surface.uv), ("vn", surface.normals)):
            if values is None:
                columns.append([])
                continue
            # They are for the eye, and most corners share them.
            rounded = np.round(values.reshape(-1, values.shape[-1]), LOOK_DIGITS)
            used, places = np.unique(rounded, axis=0, return_inverse=True)
            lines += [f"{tag} " + " ".join(f"{x:.{LOOK_DIGITS}g}" for x in row) for row in used.tolist()]
            columns.append((places.reshape(-1) + 1 + count[tag]).tolist())
            count[tag] += len(used)
        if look.rgba is not None or look.texture is not None:
            red, green, blue, opacity = look.rgba or (1.0, 1.0, 1.0, 1.0)
            materials += [f"newmtl m{number}", f"Kd {red!r} {green!r} {blue!r}", f"d {opacity!r}"]
            lines.append(f"usemtl m{number}")
            if look.texture is not None and surface.uv is not None:
                name = f"{stem}_{number}.png"
                images[name] = look.texture.png
                materials.append(f"map_Kd {name}")
        lines += _faces(*columns)
    if not materials:
        lines = lines[1:]
    yield f"{stem}.obj", ("\n".join(lines) + "\n").encode()
    if materials:
        yield f"{stem}.mtl", ("\n".join(materials) + "\n").encode()
    yield from images.items()


def _is_plain(part: tuple[Mesh, object]) -> bool:
    look = part[1]
    return getattr(look, "rgba", None) is not None or getattr(look, "texture", None) is not None


def _faces(vertices: list[int], places: list[int], normals: list[int]) -> Iterator[str]:
    """Yield the lines of triangles, of which each corner has a vertex and may have a place and a normal."""
    if places and normals:
        words = [f"{a}/{b}/{c}" for a, b, c in zip(vertices, places, normals, strict=True)]
    elif places:
        words = [f"{a}/{b}" for a, b in zip(vertices, places, strict=True)]
    elif normals:
        words = [f"{a}//{c}" for a, c in zip(vertices, normals, strict=True)]
    else:
        words = [str(a) for a in vertices]
    corners = iter(words)
    for a, b, c in zip(corners, corners, corners, strict=True):
        yield f"f {a} {b} {c}"


def _is_copied(content: bytes, suffix: str) -> bool:
    """Check whether MuJoCo reads this file, which reads no STL in words and no large one."""
    if suffix != ".stl":
        return True
    triangles = int.from_bytes(content[80:84], "little")
    return len(content) == 84 + 50 * triangles and triangles <= MAX_STL_TRIANGLES


def _companions(path: str) -> Iterator[str]:
    """Yield the files that a mesh names: materials and images that can be found."""
    folder = os.path.dirname(path)
    if path.lower().endswith(".obj"):
        for line in read_file(path).decode("latin-1").splitlines():
            if line.startswith("mtllib "):
                found = os.path.join(folder, line.removeprefix("mtllib ").strip())
                # A path that leads elsewhere is not followed, as when the mesh is read.
                inside = os.path.realpath(found).startswith(os.path.join(os.path.realpath(folder), ""))
                if inside and os.path.isfile(found):
                    yield found
    if not path.lower().endswith(".stl"):
        with suppress(DynxError):
            for material in mesh_file(path).described.materials:
                if material.image is not None and material.image.content is None:
                    with suppress(ValueError):
                        yield image_file(path, material.image.name)


def _sources(geometry: Geometry) -> Iterator[str]:
    """Yield the files of a robot's meshes and images."""
    for link in geometry.links.values():
        shapes = [*(each.shape for each in link.visuals), *(each.shape for each in link.collisions)]
        for shape in shapes:
            if isinstance(shape, Mesh) and shape.file and shape.fault is None:
                yield shape.file
                with suppress(DescriptionError):
                    yield from _companions(shape.file)
        for visual in link.visuals:
            material = visual.material
            if material is not None and material.texture is not None and not material.fault:
                yield material.texture


def _common_folder(paths: Iterable[str]) -> str:
    """Return the innermost folder that holds all files; empty without one."""
    folders = {os.path.dirname(os.path.realpath(path)) for path in paths}
    try:
        return os.path.commonpath(folders) if folders else ""
    except ValueError:  # On different drives.
        return ""
