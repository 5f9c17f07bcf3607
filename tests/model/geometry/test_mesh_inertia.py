"""Volume and moments of meshes of files, which are computed once for each file."""

from __future__ import annotations

import os
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.model.geometry import Box, Mesh
from dynx.model.geometry.mesh_inertia import mesh_properties
from dynx.model.geometry.solids import solid_properties

FACES = (
    *((0, 1, 2), (1, 3, 2), (4, 6, 5), (5, 6, 7), (0, 4, 1), (1, 4, 5)),
    *((2, 3, 6), (3, 7, 6), (0, 2, 4), (2, 6, 4), (1, 5, 3), (3, 5, 7)),
)
"""Triangles of a box by the numbers of its corners."""


def write_box(path: Path, size: tuple[float, float, float]) -> None:
    corners = product(*((-each / 2.0, each / 2.0) for each in size))
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in corners]
    path.write_text("\n".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in FACES)]))


@pytest.mark.parametrize("kind", ["convex", "exact", "legacy"])
def test_a_mesh_of_a_box_has_its_properties_also_after_the_file_changes(kind: str, tmp_path: Path) -> None:
    path = tmp_path / "box.obj"
    scale = np.array((-1.0, 2.0, 0.5))
    for number, size in enumerate(((1.0, 2.0, 3.0), (2.0, 1.0, 0.5))):
        write_box(path, size)
        os.utime(path, ns=(number, number))
        for factor in (np.ones(3), scale):
            x, y, z = np.abs(factor) * size
            expected = solid_properties(Box((x, y, z)))
            for _ in range(2):
                found = mesh_properties(Mesh(str(path), tuple(factor.tolist())), kind)
                assert abs(found.volume - expected.volume) <= BAR * expected.volume
                assert np.abs(found.center).max() <= BAR
                assert np.abs(found.inertia - expected.inertia).max() <= BAR * expected.inertia.max()
