"""DX516 mesh-not-found: The file of a mesh, or of the texture of a visual, is not where the description says.

Reported are files whose location is certain: a path relative to the description, a ``file://`` path, or a
file in a package that was found (in the folders above the description, in ROS_PACKAGE_PATH or
AMENT_PREFIX_PATH) but does not contain it. On a case-sensitive file system ``Base.STL`` is not ``base.stl``.
Paths that leave the package or repository of the description are not looked at.

PyBullet 3.2.7 refuses the whole file ("Cannot load URDF file") for a mesh in ``<visual>`` or in
``<collision>``, and so does Drake 1.51 with a scene graph; MuJoCo 4.0 does for ``<collision>`` alone, since
it discards what is only visual. A texture in ``<visual>`` is missed by Drake with a scene graph alone; one in
a material of the robot is DX426. Pinocchio's ``buildModelFromUrdf`` reads no mesh, its ``buildGeomFromUrdf``
raises. PyBullet takes every path, ``/meshes/a.stl`` too, as relative to the folder of the description and to
each folder above it, and searches folders of its own (``setAdditionalSearchPath``), so it may find meshes
that others do not; the message says which file it finds in the package or repository. Dynamics does not
depend on shapes, and dynx reads the file without them.

The description does not say which file was meant, so no edit removes the cause; the message gives the nearest
name.
"""

from collections.abc import Iterable

from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, found_by_bullet
from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import geometry_elements, visual_textures


class MeshNotFound(Rule):
    kind = "practice"
    advice = "Put the file there, or correct the path, capitals included."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first reference to each missing file."""
        seen = {""}
        for name, link in case.links.items():
            shapes = [each for each in geometry_elements(link) if each.tag == "mesh"]
            for element in (*shapes, *visual_textures(link)):
                filename = element.attributes.get("filename", "")
                if filename in seen:
                    continue
                seen.add(filename)
                try:
                    find_mesh(filename, case.source.source)
                except MeshNotFoundError as error:
                    where = found_by_bullet(filename, case.source.source)
                    yield Detection(name, None, element.line, f"{error}{where}")
