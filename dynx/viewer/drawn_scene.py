"""Robots and bodies of a scene as nodes of the page, placed by the poses of their parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.geometry import Mesh
from dynx.spatial.scalar import Floats
from dynx.viewer.colours import VERMILION
from dynx.viewer.drawn_parts import DrawnParts
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnRobot, Look, add_triangles, rgb_of
from dynx.viewer.triangles import reduced, resized
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


class ContactArrows:
    """An arrow for each contact, along its force, at its point; the scale is fixed, in metres a newton."""

    def __init__(self, scene: Any, metres_per_newton: float, thickness: float) -> None:
        self._scene, self._scale, self._thickness = scene, metres_per_newton, thickness
        self._node: Any = None
        self.shown = True
        """True while the arrows are shown."""

    def put(self, points: Floats, forces: Floats) -> None:
        """Show forces (m, 3) [N] at points (m, 3) [m], in world axes."""
        if not self.shown or not len(points):
            if self._node is not None:
                self._node.visible = False
            return
        ends = points + self._scale * forces
        segments = np.stack([points, ends], axis=1).astype(np.float32)
        if self._node is None:
            self._node = self._scene.add_arrows(
                "/contact_forces",
                segments,
                VERMILION,
                shaft_radius=self._thickness,
                head_radius=2.5 * self._thickness,
                head_length=4.0 * self._thickness,
            )
        else:
            self._node.points = segments
            self._node.visible = True
