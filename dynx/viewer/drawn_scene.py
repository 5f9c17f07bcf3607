"""Robots and bodies of a scene as nodes of the page, placed by the poses of their parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.geometry import Mesh
from dynx.viewer.drawn_parts import DrawnParts
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnRobot, Look, add_triangles, rgb_of
from dynx.viewer.surfaces.reduction import reduced
from dynx.viewer.surfaces.triangles import resized
from dynx.world.scene import SceneBody


class DrawnScene(DrawnParts):
    """Robots by name and bodies; a part is a body, or a link as ``robot/link``."""

    def __init__(
        self,
        scene: Any,
        path: str,
        robots: Mapping[str, Model],
        bodies: Iterable[SceneBody] = (),
        look: Look = AS_DESCRIBED,
    ) -> None:
        """`scene` is that of a viser server, and `path` the node of everything drawn here."""
        root = scene.add_frame(path, show_axes=False)
        self.robots = {
            name: DrawnRobot(scene, f"{path}/robot{k}", model, look)
            for k, (name, model) in enumerate(robots.items())
        }
        """The robots by name."""
        parts: dict[str, Any] = {
            f"{robot}/{link}": node
            for robot, drawn in self.robots.items()
            for link, node in drawn.links.items()
        }
        faults = [
            fault if fault.startswith(f"{name} ") else f"{name}: {fault}"
            for name, drawn in self.robots.items()
            for fault in drawn.notes
        ]
        start = {
            f"{robot}/{link}": drawn.pose(link)
            for robot, drawn in self.robots.items()
            for link in drawn.links
        }
        self._bodies: dict[str, list[Any]] = {}
        for k, body in enumerate(bodies):
            node = parts[body.name] = scene.add_frame(f"{path}/body{k}", show_axes=False)
            self._bodies[body.name] = []
            try:
                self._bodies[body.name] = list(_add_body(scene, node, body, look))
            except DynxError as error:
                faults.append(f"{body.name}: {error}")
            start[body.name] = body.pose.matrix
        above = {
            f"{robot}/{link}": f"{robot}/{parent}"
            for robot, drawn in self.robots.items()
            for link, parent in drawn.above.items()
        }
        super().__init__(root, parts, above)
        self.place(start)
        self.faults = tuple(faults)
        """Shapes that cannot be drawn, one sentence each."""

    @property
    def visuals(self) -> dict[str, list[Any]]:
        """The nodes of the visual shapes of each link of the robots, and of each body."""
        links = {
            f"{name}/{link}": nodes
            for name, robot in self.robots.items()
            for link, nodes in robot.visuals.items()
        }
        return links | self._bodies

    def show(self, *, visuals: bool, collisions: bool) -> None:
        """Show or hide the visual shapes and the collision shapes of the robots."""
        for robot in self.robots.values():
            robot.show(visuals=visuals, collisions=collisions)


def _add_body(scene: Any, node: Any, body: SceneBody, look: Look) -> Iterator[Any]:
    rgba = body.material.rgba
    opacity = look.opacity or (None if rgba[3] == 1.0 else rgba[3])
    for k, placed in enumerate(body.shapes):
        yield add_triangles(
            scene,
            f"{node.name}/shape{k}",
            resized(reduced(placed.shape, look.triangles), look.size),
            placed.origin.matrix,
            look.colour or rgb_of(rgba),
            opacity,
            flat=isinstance(placed.shape, Mesh),
        )
