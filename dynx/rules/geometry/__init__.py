"""How far the shapes of a link reach: what rules compare masses and inertias with."""

from dynx.rules.geometry.extent import Extent
from dynx.rules.geometry.mesh_files import MeshNotFoundError, find_mesh
from dynx.rules.geometry.rigid_shapes import welded_extents

__all__ = ["Extent", "MeshNotFoundError", "find_mesh", "welded_extents"]
