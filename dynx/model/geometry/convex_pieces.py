"""Convex pieces of a concave mesh: the objects of its file, or an approximate convex decomposition.

A mesh collides as one convex hull on every engine. Pieces are meshes in files of their own, so that engines,
descriptions and scenes treat them as any other shapes. No other module imports coacd.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, DescriptionError, importing, shown
from dynx.files.reading import printable, read_file
from dynx.files.writing import write_bytes
from dynx.model.geometry.formats.facets import obj_objects
from dynx.model.geometry.mesh import Mesh
from dynx.model.geometry.mesh_reading import read_triangles
from dynx.model.numbers import positive_number
from dynx.spatial.scalar import Floats


@checks_types
def mesh_objects(mesh: Mesh, folder: str | os.PathLike[str]) -> tuple[Mesh, ...]:
    """Write each object of an OBJ file to a file of its own in a folder, and return these meshes, with the
    scale of the given one, in the order of the file.

    An object begins with each line ``o`` or ``g`` and has at least one face. PyBullet's own ``loadURDF``
    makes one convex piece of each; other loaders make one hull of all. Raises ArgumentError for a file of
    another format, and the errors of `Mesh.triangles`.
    """
    if not mesh.file.lower().endswith(".obj"):
        raise ArgumentError(
            f"{shown(mesh.name)} is no OBJ file, which lists objects; convex_decomposition divides any mesh"
        )
    if mesh.fault is not None:
        raise mesh.fault
    vertices, _ = read_triangles(mesh.file)
    try:
        parts = obj_objects(read_file(mesh.file))
    except ValueError as error:
        raise DescriptionError(f"cannot be read as .obj: {error}", source=printable(mesh.file)) from None
    return _written(mesh, folder, [(vertices, faces) for faces in parts])


@checks_types
def convex_decomposition(
    mesh: Mesh, folder: str | os.PathLike[str], *, concavity: float = 0.05
) -> tuple[Mesh, ...]:
    """Divide a mesh into pieces that are nearly convex, write their hulls to files in a folder, and return
    these meshes, with the scale of the given one.

    `concavity` bounds the distance between a piece and its hull, for a mesh as large as the box from -1 to 1
    (the threshold of Wei, Liu, Ling and Su, Approximate Convex Decomposition for 3D Meshes with
    Collision-Aware Concavity and Tree Search, 2022). Equal arguments give equal pieces. Raises ArgumentError
    for a concavity that is not above 0 and at most 1, the errors of `Mesh.triangles`, and NotInstalledError
    without the extra ``decomposition``.
    """
    if positive_number("concavity", concavity) > 1.0:
        raise ArgumentError(f"concavity is {concavity}; wanted above 0 and at most 1")
    if mesh.fault is not None:
        raise mesh.fault
    vertices, faces = replace(mesh, scale=(1.0, 1.0, 1.0)).triangles
    coacd = _coacd()
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(vertices, faces.astype(np.int32)), threshold=concavity, seed=0)
    return _written(mesh, folder, [(np.asarray(v), np.asarray(f, np.intp)) for v, f in parts])


def _coacd() -> Any:
    with importing("convex decompositions are made by coacd: pip install 'dynx[decomposition]'"):
        import coacd
    return coacd


def _written(
    mesh: Mesh, folder: str | os.PathLike[str], parts: Sequence[tuple[Floats, NDArray[np.intp]]]
) -> tuple[Mesh, ...]:
    """Write vertices (n, 3) and triangles (m, 3) of pieces, unscaled, and return their meshes."""
    place = Path(os.fsdecode(folder))
    place.mkdir(parents=True, exist_ok=True)
    stem, pieces = Path(mesh.name).stem, []
    for number, (vertices, faces) in enumerate(parts):
        used, renumbered = np.unique(faces, return_inverse=True)
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices[used].tolist()]
        lines += [f"f {a} {b} {c}" for a, b, c in (renumbered.reshape(-1, 3) + 1).tolist()]
        path = place / f"{stem}_piece{number}.obj"
        write_bytes(path, ("\n".join(lines) + "\n").encode())
        pieces.append(Mesh(str(path), mesh.scale))
    return tuple(pieces)
