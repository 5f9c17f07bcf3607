"""Robots and bodies of a scene as nodes of the page, placed by the poses of their parts."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.geometry import Mesh
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnParts, DrawnRobot, Look, add_triangles, rgb_of, wxyz
from dynx.viewer.triangles import triangles_of
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
        faults = [f"{name}: {fault}" for name, drawn in self.robots.items() for fault in drawn.notes]
        for k, body in enumerate(bodies):
            node = parts[body.name] = scene.add_frame(f"{path}/body{k}", show_axes=False)
            try:
                _add_body(scene, node, body, look)
            except DynxError as error:
                faults.append(f"{body.name}: {error}")
            node.wxyz, node.position = wxyz(body.pose.matrix[:3, :3]), body.pose.matrix[:3, 3]
        super().__init__(root, parts)
        self.faults = tuple(faults)
        """Shapes that cannot be drawn, one sentence each."""

    def show(self, *, visuals: bool, collisions: bool) -> None:
        """Show or hide the visual shapes and the collision shapes of the robots."""
        for robot in self.robots.values():
            robot.show(visuals=visuals, collisions=collisions)


def _add_body(scene: Any, node: Any, body: SceneBody, look: Look) -> None:
    rgba = body.material.rgba
    opacity = look.opacity or (None if rgba[3] == 1.0 else rgba[3])
    for k, placed in enumerate(body.shapes):
        budget = look.triangles if isinstance(placed.shape, Mesh) else None
        add_triangles(
            scene,
            f"{node.name}/shape{k}",
            triangles_of(placed.shape, budget),
            placed.origin.matrix,
            look.colour or rgb_of(rgba),
            opacity,
            flat=isinstance(placed.shape, Mesh),
        )
