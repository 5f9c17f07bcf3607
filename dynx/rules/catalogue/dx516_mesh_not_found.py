"""DX516 mesh-not-found: The file of a mesh is not where the description says it is.

Reported are meshes whose place is certain: a path relative to the description, a ``file://`` path, or a
file in a package that was found (in the folders above the description, in ROS_PACKAGE_PATH or
AMENT_PREFIX_PATH) and does not have it. On a system that tells capitals apart, ``Base.STL`` is not
``base.stl``.

PyBullet 3.2.7 refuses the whole file ("Cannot load URDF file") for a mesh in ``<visual>`` or in
``<collision>``, and so does Drake 1.51 with a scene graph; MuJoCo 4.0 does for ``<collision>`` alone, since
it discards what is only visual. Pinocchio's ``buildModelFromUrdf`` looks at no mesh, its
``buildGeomFromUrdf`` raises. PyBullet looks in folders of its own as well (``setAdditionalSearchPath``), so
it may find what nobody else does. Dynamics does not depend on shapes, and dynx reads the file without them.

Which file was meant is not in the description, so there is no remedy by edit; the message has the
nearest name.
"""

from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import MeshNotFoundError, find_mesh
from dynx.rules.geometry.shapes import geometry_elements


class MeshNotFound(Rule):
    kind = "practice"
    advice = "Put the mesh there, or mend the path, capitals included."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """The first place at which each missing mesh is named."""
        found, seen = [], set()
        for name, link in case.links.items():
            for element in geometry_elements(link):
                filename = element.attributes.get("filename", "")
                if element.tag != "mesh" or filename in seen:
                    continue
                seen.add(filename)
                try:
                    find_mesh(filename, case.source.source)
                except MeshNotFoundError as error:
                    found.append(Detection(name, None, element.line, str(error)))
        return found
