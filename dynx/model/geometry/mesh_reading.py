"""Files of meshes, read once until they change: triangles and, where these are drawn, what they look like.

Readers of the formats return what a file says (`formats`); here it is checked, images are read, and
triangles are divided into parts of one look. Files come from anyone: only the folder of the mesh is read,
and for images the `enclosing_folder` of what belongs to it.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.errors import DescriptionError, DynxError, shown
from dynx.files.reading import printable, read_file
from dynx.model.geometry.formats.surface import MAX_TRIANGLES, Colour, FileSurface, ImageFile
from dynx.model.geometry.images import MAX_PIXELS, Texture, read_texture
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.model.package_search import enclosing_folder
from dynx.spatial.scalar import Floats

Faces = NDArray[np.intp]

MAX_PARTS = 100
"""Largest number of parts of one colour; more colours are those of corners."""

MAX_IMAGES = 32
"""Largest number of images of a mesh that are read; together they may have as many pixels as two can have."""

FORMATS = (".stl", ".obj", ".dae", ".gltf", ".glb")
"""Suffixes of the files that are read."""


class Surface(NamedTuple):
    """Triangles and what they look like, beside a colour of the whole."""

    vertices: Floats
    """Shape (n, 3) [m]."""
    faces: Faces
    """Vertices of each triangle (m, 3), counter-clockwise from outside."""
    normals: Floats | None = None
    """Unit normal at each corner (m, 3, 3); None for flat triangles."""
    uv: Floats | None = None
    """Place of each corner in the image (m, 3, 2)."""
    texture: Texture | None = None
    """The image that is shown."""
    colours: Floats | None = None
    """Red, green and blue of each corner (m, 3, 3) from 0 to 1; interpolated between corners."""


class SurfacePart(NamedTuple):
    """The triangles of one look."""

    numbers: Faces
    """Numbers of the triangles (m,)."""
    rgba: Colour | None
    """Their colour, or factors of those of image or corners; None for the colour of whatever has the mesh."""
    texture: Texture | None = None
    by_corners: bool = False
    """Whether the corners have colours of their own."""

    @property
    def is_varied(self) -> bool:
        """Whether the colour changes from place to place."""
        return self.texture is not None or self.by_corners


def read_triangles(path: str, part: int | None = None) -> tuple[Floats, Faces]:
    """Return the vertices (n, 3) [m] and triangles (m, 3) of a mesh file, or of a part of it, unscaled.

    The result is shared between calls until the file changes. Raises RobotNotFoundError for a missing file,
    DescriptionError for one that is too large, damaged, empty or of another format, NotInstalledError for
    glTF without trimesh.
    """
    file = mesh_file(path)
    return file.triangles if part is None else file.surface(part, np.ones(3))[:2]


def mesh_file(path: str) -> MeshFile:
    """Return the file of a mesh, the same one until the file changes."""
    try:
        status = os.stat(path)
    except (OSError, ValueError):
        return MeshFile(path)
    return _cached(path, status.st_mtime_ns, status.st_size)


# A robot names its meshes twice, and is often loaded into several engines.
@lru_cache(maxsize=64)
def _cached(path: str, changed: int, size: int) -> MeshFile:
    return MeshFile(path)


class MeshFile:
    """A file of a mesh, of which as much is read as is asked for; it raises what `read_triangles` does."""

    def __init__(self, path: str) -> None:
        self._path = path

    @cached_property
    def triangles(self) -> tuple[Floats, Faces]:
        """Vertices (n, 3) [m] and triangles (m, 3)."""
        # What is drawn was read already, with the same triangles.
        known = self.__dict__.get("described")
        found = known if isinstance(known, FileSurface) else self._read(drawn=False)
        return found.vertices, found.faces

    @cached_property
    def described(self) -> FileSurface:
        """What the file says about the surface."""
        return self._read(drawn=True)

    @cached_property
    def _parts_and_notes(self) -> tuple[tuple[SurfacePart, ...], tuple[str, ...]]:
        return _divided(self._path, self.described)

    @property
    def parts(self) -> tuple[SurfacePart, ...]:
        """The triangles, divided by their look."""
        return self._parts_and_notes[0]

    @property
    def notes(self) -> tuple[str, ...]:
        """What the surface is drawn without, one sentence each, with the file."""
        return self._parts_and_notes[1]

    def surface(self, part: int | None, scale: Floats) -> Surface:
        """Return the surface of a part, or of all triangles without colours, scaled along x, y and z (3,)."""
        found = self.described
        chosen = SurfacePart(np.arange(len(found.faces)), None) if part is None else self.parts[part]
        faces, normals = found.faces[chosen.numbers], found.normals
        uv = found.uv[chosen.numbers] if chosen.texture is not None and found.uv is not None else None
        colours = found.colours[chosen.numbers] if chosen.by_corners and found.colours is not None else None
        vertices = found.vertices
        if part is not None:
            used, faces = np.unique(faces, return_inverse=True)
            vertices, faces = vertices[used], faces.reshape(-1, 3)
        vertices = vertices * scale
        # A mirrored triangle is seen from behind.
        order = -1 if np.prod(np.sign(scale)) < 0.0 else 1
        faces = faces[:, ::order]
        if normals is not None:
            normals = _unit_normals(vertices, faces, normals[chosen.numbers][:, ::order] / scale)
        return Surface(
            vertices,
            faces,
            normals,
            None if uv is None else uv[:, ::order],
            chosen.texture,
            None if colours is None else colours[:, ::order],
        )

    def textured_surface(self, texture: Texture, scale: Floats) -> Surface | None:
        """Return the surface of all triangles with another image; None for a file without places in it."""
        found, uv = self.surface(None, scale), self.described.uv
        if uv is None or np.isnan(uv).any():
            return None
        mirrored = np.prod(np.sign(scale)) < 0.0
        return found._replace(uv=uv[:, ::-1] if mirrored else uv, texture=texture)

    def _read(self, *, drawn: bool) -> FileSurface:
        path = self._path
        suffix = os.path.splitext(path)[1].lower()
        if suffix not in FORMATS:
            raise _fault(path, f"has the suffix {shown(suffix)}; meshes are read from {', '.join(FORMATS)}")
        found = _parsed(path, read_file(path), suffix, drawn=drawn)
        vertices, faces = found.vertices, found.faces
        if len(faces) == 0:
            raise _fault(path, "holds no triangle")
        if len(faces) > MAX_TRIANGLES:
            raise _fault(path, f"holds {len(faces)} triangles; at most {MAX_TRIANGLES} are read")
        if not np.abs(vertices).max() < MAX_MAGNITUDE:
            raise _fault(path, f"holds a vertex that is not finite or not below {MAX_MAGNITUDE:g}")
        if faces.min() < 0 or faces.max() >= len(vertices):
            raise _fault(path, f"holds a triangle of a vertex that is not among its {len(vertices)}")
        vertices.flags.writeable = faces.flags.writeable = False
        return found


def _parsed(path: str, data: bytes, suffix: str, *, drawn: bool) -> FileSurface:
    beside = partial(_read_beside, path)
    try:
        # Imported here, because nobody asks for the meshes of most robots, or for those of one format.
        if suffix in (".stl", ".obj"):
            from dynx.model.geometry.formats import facets

            if suffix == ".stl":
                return facets.stl_surface(data) if drawn else FileSurface(*facets.stl_triangles(data))
            return facets.obj_surface(data, beside) if drawn else FileSurface(*facets.obj_triangles(data))
        if suffix == ".dae":
            from dynx.model.geometry.formats import collada

            return collada.collada_surface(data) if drawn else FileSurface(*collada.collada_triangles(data))
        from dynx.model.geometry.formats import gltf

        return gltf.gltf_surface(data, beside) if drawn else FileSurface(*gltf.gltf_triangles(data, beside))
    except DynxError:
        raise
    # trimesh raises whatever exception damaged data lead to, as do lookups in the tree of such a file.
    except Exception as error:
        reason = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
        raise _fault(path, f"cannot be read as {suffix}: {reason}") from error


def _read_beside(path: str, name: str) -> bytes:
    """Return the bytes of a file in the folder of a mesh; ValueError for one outside."""
    folder = os.path.realpath(os.path.dirname(path))
    found = os.path.realpath(os.path.join(folder, name))
    if not found.startswith(os.path.join(folder, "")):
        raise ValueError(f"{shown(name, 200)} is outside the folder of the mesh")
    return read_file(found)


def _fault(path: str, message: str) -> DescriptionError:
    return DescriptionError(message, source=printable(path))


def _divided(path: str, found: FileSurface) -> tuple[tuple[SurfacePart, ...], tuple[str, ...]]:
    """Return the parts of a surface, and notes on what of it is not drawn."""
    notes = list(found.notes)
    count = len(found.faces)
    material_of = np.zeros(count, np.intp) if found.material_of is None else found.material_of
    coloured, placed = _complete(found.colours, count), _complete(found.uv, count)
    groups: dict[tuple[Colour | None, int, bool], list[Faces]] = {}
    textures: dict[ImageFile, Texture | None] = {}
    for number in np.unique(material_of):
        material, of = found.materials[number], material_of == number
        texture = None
        if material.image is not None:
            if material.image not in textures:
                textures[material.image] = _texture(path, material.image, notes, textures.values())
            texture = textures[material.image]
        if texture is not None and not placed[of].all():
            notes.append(f"{int((of & ~placed).sum())} triangles have no places in their image")
        shows = of & placed if texture is not None else np.zeros(count, np.bool_)
        looks = (
            (shows, material.tint, id(texture), False),
            (of & ~shows & coloured, material.tint, 0, True),
            (of & ~shows & ~coloured, material.rgba, 0, False),
        )
        for chosen, rgba, image, by_corners in looks:
            if chosen.any():
                groups.setdefault((rgba, image, by_corners), []).append(np.flatnonzero(chosen))
    by_id = {id(each): each for each in textures.values() if each is not None}
    parts = [
        SurfacePart(np.sort(np.concatenate(numbers)), rgba, by_id.get(image), by_corners)
        for (rgba, image, by_corners), numbers in groups.items()
    ]
    if len(parts) > MAX_PARTS:
        notes.append(f"its {len(parts)} materials are more than {MAX_PARTS}, and are drawn without colours")
        parts = [SurfacePart(np.arange(count), None)]
    return tuple(parts), tuple(dict.fromkeys(f"{os.path.basename(path)}: {each}" for each in notes))


def _complete(values: Floats | None, count: int) -> NDArray[np.bool_]:
    """Return for each of `count` triangles whether all of its corners have values (m, 3, k)."""
    if values is None:
        return np.zeros(count, np.bool_)
    return np.asarray(np.isfinite(values).all(axis=(1, 2)))


def _texture(
    path: str, image: ImageFile, notes: list[str], known: Collection[Texture | None]
) -> Texture | None:
    """Return the image of a material beside those that are `known`; None, with a note, for one that cannot be
    read."""
    pixels = sum(each.pixels.size // 3 for each in known if each is not None)
    try:
        if len(known) >= MAX_IMAGES or pixels > MAX_PIXELS:
            raise ValueError(f"the images of a mesh are at most {MAX_IMAGES}, of {2 * MAX_PIXELS} pixels")
        content = image_content(path, image.name) if image.content is None else image.content
        return read_texture(content, image.wraps)
    except (DynxError, ValueError) as error:
        notes.append(f"image {shown(image.name, 200)} is not shown: {error}")
        return None


def image_content(path: str, name: str) -> bytes:
    """Return the bytes of an image that the file of a mesh names, relative to its folder or beside it.

    Raises the errors of `image_file`.
    """
    return read_file(image_file(path, name))


def image_file(path: str, name: str) -> str:
    """Return the path of an image that the file of a mesh names, relative to its folder or beside it.

    Raises ValueError for one outside the folder of what belongs to the mesh, and where none is there.
    """
    folder = Path(os.path.realpath(os.path.dirname(path)))
    root = enclosing_folder(folder)
    for each in (name, os.path.basename(name)):
        real = Path(os.path.realpath(folder / each))
        if not real.is_relative_to(root):
            continue
        if os.path.isfile(real):
            return str(real)
    scheme, address, _ = name.partition("://")
    if address and scheme != "file":
        raise ValueError(f"dynx reads no {shown(scheme + address)}")
    outside = not Path(os.path.realpath(folder / name)).is_relative_to(root)
    raise ValueError(f"it is outside the folder {shown(root.name)}" if outside else "no such file")


def _unit_normals(vertices: Floats, faces: Faces, normals: Floats) -> Floats:
    """Return normals (m, 3, 3) with length 1; those of the triangle where a corner has none."""
    size = np.linalg.norm(normals, axis=2, keepdims=True)
    known = np.isfinite(size) & (size > 0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        normals = normals / size
        if known.all():
            return normals
        a, b, c = np.moveaxis(vertices[faces], 1, 0)
        flat = np.cross(b - a, c - a)
        flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    return np.where(known, normals, np.nan_to_num(flat, nan=0.0)[:, None])
