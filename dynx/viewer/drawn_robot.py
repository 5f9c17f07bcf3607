"""Robots and scenes as nodes of the page, placed by configuration or by poses of parts."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DynxError, nearest, shown
from dynx.model import Model
from dynx.model.geometry import Mesh, Plane, Shape
from dynx.model.geometry.drawn_shapes import colliding_geometry, link_shapes, look_notes
from dynx.model.geometry.links import Collision, Colour, Visual
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation, rotation_from_quat
from dynx.viewer.colours import ORANGE, RGB, VERMILION, YELLOW
from dynx.viewer.copied_shapes import CopiedShape, ShapeCopy
from dynx.viewer.framing import has_ground
from dynx.viewer.painted import PaintedNode, glb, light_of
from dynx.viewer.pose_channel import CopiedNode, PoseChannel
from dynx.viewer.triangles import (
    TRIANGLE_BUDGET,
    Triangles,
    budgets,
    hull_of,
    reduced,
    reduced_surface,
    resized,
    turned_outwards,
    with_edges,
)
from dynx.world import SceneBody
from dynx.world.scenery import LIGHT, Scenery

_STILL = 1e-12
"""Change of a pose below which it is not sent [m, and entries of a rotation]."""

Quaternion = tuple[float, float, float, float]


class DrawnParts:
    """Nodes of the page by the names of parts, below one root.

    The node of a part may lie below that of another, and what is fixed to a part moves with it.
    """

    visuals: dict[str, list[Any]]
    """The nodes of the visual shapes of each part."""

    def __init__(
        self,
        scene: Any,
        root: Any,
        parts: dict[str, Any],
        above: Mapping[str, str],
        roots: Mapping[str, str],
        rigid: Mapping[str, str],
        copied: Mapping[CopiedShape, Sequence[str]] = {},
    ) -> None:
        """`above` names the part below whose node that of a part lies; the others lie below the root. `rigid`
        names the parent of each part that a fixed joint connects to it. A part without a node, None, is shown
        by `copied`: shapes, each with the names of the parts that its copies show."""
        self._scene_of_parts, self._root, self._rigid = scene, root, dict(rigid)
        self.parts = parts
        """The node of each part; None for one that is shown by copies and has needed no node yet."""
        self._copied = dict(copied)
        self.roots = dict(roots)
        """The root link of each robot, by the name of the robot."""
        self._number = {name: k for k, name in enumerate(parts)}
        # The last row is the world.
        self._above = np.array([self._number[above[n]] if n in above else -1 for n in parts], dtype=np.intp)
        self._poses = np.tile(np.eye(4), (len(parts) + 1, 1, 1))
        self._sent = np.full((len(parts), 3, 4), np.nan)
        nodes = {self._number[name]: node for name, node in parts.items() if node is not None}
        self._channel = PoseChannel(root, nodes, map(self._placed_by, copied))
        self._placed: list[Callable[[Mapping[str, Floats]], None]] = []
        self.grounds = frozenset[str]()
        """Parts on which others stand: planes and height fields."""
        self.hidden = set[str]()
        """Parts whose shapes are hidden, whichever shapes are shown."""

    def set_visible(self, name: str, visible: bool) -> None:
        """Show or hide the shapes of a part."""
        (self.hidden.discard if visible else self.hidden.add)(name)
        for node in self.visuals.get(name, ()):
            node.visible = visible

    def path_of(self, name: str) -> str:
        """Return the path of a node that moves with a part."""
        if self.parts[name] is None:
            number = self._number[name]
            node = self._scene_of_parts.add_frame(f"{self._root.name}/part{number}", show_axes=False)
            self.parts[name] = node
            self._channel.add(number, node)
            self._send([number])
        return str(self.parts[name].name)

    @property
    def names_by_path(self) -> dict[str, str | list[str]]:
        """The names of parts by the paths of their nodes; of nodes of copies, those of all copies."""
        names: dict[str, str | list[str]] = {
            node.name: name for name, node in self.parts.items() if node is not None
        }
        return names | {shape.node.name: list(parts) for shape, parts in self._copied.items()}

    @property
    def listed(self) -> tuple[str, ...]:
        """The parts among which the panel lets choose."""
        return tuple(self.parts)

    @property
    def choices(self) -> tuple[str, ...]:
        """The parts and the whole robots among which the panel lets choose what is hidden."""
        return self.listed

    def named(self, name: str) -> list[str]:
        """Return the parts of a robot, by its name, or one part. Raises ArgumentError for another name."""
        if name in self.parts:
            return [name]
        if name not in self.roots:
            raise ArgumentError(f"no part {shown(name)}{nearest(name, [*self.parts, *self.roots])}")
        return [part for part in self.parts if part == self.roots[name] or part.startswith(f"{name}/")]

    def fade(self, opacities: Mapping[str, float]) -> dict[str, float]:
        """Let copies be seen through, by the names of their parts; return the opacities of the other nodes by
        their paths, which the script of the page applies."""
        paths: dict[str, float] = {}
        copies: dict[CopiedShape, dict[int, float]] = {}
        for name, opacity in opacities.items():
            for node in self.visuals.get(name, ()):
                if isinstance(node, ShapeCopy):
                    copies.setdefault(node.shape, {})[node.number] = opacity
                else:
                    paths[node.name] = opacity
        for shape, of_copies in copies.items():
            shape.fade(of_copies)
        return paths

    def rigid_with(self, name: str) -> list[str]:
        """Return the parts that fixed joints connect to a part, itself among them."""
        body = {part: part for part in self.parts}
        for part in self.parts:  # The parent of a link is before it.
            body[part] = body[self._rigid[part]] if part in self._rigid else part
        return [part for part in self.parts if body[part] == body[name]]

    def way_out(self, point: Floats, direction: Floats, radius: float, names: Iterable[str]) -> float:
        """Return the distance [m] from a point (3,) along a unit direction (3,), both in the world, at which
        a ray leaves the visual shapes of parts, one after another, that it begins in; 0 outside of all.

        Many shapes are open where a joint's axis passes, so that what is within a `radius` [m] of the line
        counts, too; shapes that are less than that apart are one after another.
        """
        across = np.linalg.svd(direction[None])[2][1:]
        spans = []
        for name in names:
            T = self.pose(name)
            for node in self.visuals.get(name, ()):
                points = _points_of(node) @ T[:3, :3].T + T[:3, 3] - point
                along, beside = points @ direction, points @ across.T
                near = along[np.linalg.norm(beside, axis=1) <= radius]
                met = np.concatenate([near, _crossings(along, beside, np.asarray(node.faces))])
                if len(met):
                    spans.append((float(met.min()), float(met.max())))
        place = 0.0
        for begin, end in sorted(spans):
            if begin - radius <= place:
                place = max(place, end)
        return place

    def on_placed(self, placed: Callable[[Mapping[str, Floats]], None]) -> None:
        """Call `placed(poses)` whenever parts were placed."""
        self._placed.append(placed)

    def pose(self, name: str) -> Floats:
        """Return the pose (4, 4) in the world at which a part was placed last."""
        return np.array(self._poses[self._number[name]])

    def place(self, poses: Mapping[str, Floats]) -> None:
        """Place parts at the poses (4, 4) in the world given."""
        for name, T in poses.items():
            self._poses[self._number[name]] = T
        here, above = self._poses[:-1], self._poses[self._above]
        inverse = np.swapaxes(above[:, :3, :3], 1, 2)
        seen = inverse @ here[:, :3]
        seen[:, :, 3:] -= inverse @ above[:, :3, 3:]
        still = np.abs(seen - self._sent).max(axis=(1, 2), initial=0.0) <= _STILL
        moved = np.flatnonzero(~still)
        self._sent[moved] = seen[moved]
        if moved.size:
            self._send(moved.tolist())
        for placed in self._placed:
            placed(poses)

    def _send(self, moved: Iterable[int]) -> None:
        turns = np.roll(quat_from_rotation(self._sent[:, :, :3]), 1, axis=-1)
        self._channel.send(self._sent[:, :, 3], turns, moved)

    def _placed_by(self, shape: CopiedShape) -> CopiedNode:
        rows = np.array([self._number[name] for name in self._copied[shape]], dtype=np.intp)
        return CopiedNode(shape.node, rows, shape.colour)

    def _add_copied(self, copied: Mapping[CopiedShape, Sequence[str]]) -> None:
        """Show more copies of parts, at the poses that these have."""
        self._copied |= copied
        self._channel.add_copies(map(self._placed_by, copied))
        self._send([])

    def move_root(self, position: tuple[float, float, float]) -> None:
        """Shift everything drawn to a position [m] in the world; `pose` and `place` do not count it."""
        self._root.position = position

    def remove(self) -> None:
        """Remove all parts from the page."""
        self._root.remove()

    @property
    def visible(self) -> bool:
        """True while the parts are shown."""
        return bool(self._root.visible)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._root.visible = shown


def _points_of(node: Any) -> Floats:
    """Return the vertices (n, 3) of a node with triangles in the frame of its part."""
    w, *xyz = node.wxyz
    R = rotation_from_quat(np.array([*xyz, w]))
    return np.asarray(np.asarray(node.vertices, dtype=np.float64) @ R.T + node.position)


def _crossings(along: Floats, across: Floats, faces: NDArray[np.integer[Any]]) -> Floats:
    """Return where a line crosses triangles: `along` (n,) and `across` (n, 2) are the places of vertices
    along it and beside it."""
    y, z = np.moveaxis(across[faces], 2, 0)
    # The areas opposite the corners, seen along the line, all have one sign where it passes within.
    areas = np.roll(y, -1, axis=1) * np.roll(z, -2, axis=1) - np.roll(z, -1, axis=1) * np.roll(y, -2, axis=1)
    whole = areas.sum(axis=1)
    within = ((areas >= 0.0).all(axis=1) | (areas <= 0.0).all(axis=1)) & (whole != 0.0)
    return np.asarray(np.einsum("ij,ij->i", areas[within], along[faces[within]]) / whole[within])


def wxyz(R: Floats) -> Quaternion:
    """Return the unit quaternion (w, x, y, z) of a rotation (3, 3), as viser writes it."""
    x, y, z, w = quat_from_rotation(R).tolist()
    return (w, x, y, z)


COLLISION_OPACITY = 0.4
GHOST_OPACITY = 0.45
GHOST_SIZE = 0.99
"""Size of the shapes of a ghost: inside those that it coincides with, or the picture would flicker there."""


class Look(NamedTuple):
    """How a robot is drawn."""

    colour: RGB | None = None
    """One colour for all links instead of their own."""
    opacity: float | None = None
    """Opacity from 0 to 1; None for that of each shape."""
    triangles: int | None = TRIANGLE_BUDGET
    """Largest number of triangles of all visual meshes; None draws them whole."""
    size: float = 1.0
    """Size of each shape, about its middle, relative to its own."""
    scenery: Scenery = LIGHT
    """Light and colours of the page."""


AS_DESCRIBED = Look()
"""Shapes in their own colours, heavy meshes reduced."""


class RobotShapes:
    """What is drawn of a robot, or of copies of it: the shapes of its links, heavy ones reduced."""

    def __init__(self, model: Model, look: Look, copies: int = 1) -> None:
        self.model, self._look, self._copies = model, look, copies
        self._faults: dict[str, list[str]] = {}
        self._reduced = (0, 0)
        self._lacks_collisions = False
        self.visuals = {link.name: self._visible_shapes(link.name) for link in model.links}
        """The visual shapes of each link, with their colours and poses in it."""
        self._share = self._shares(shape for placed in self.visuals.values() for shape, _, _ in placed)

    def budget(self, shape: Shape) -> int | None:
        """Return the largest number of triangles of a visual shape; None for one that stays whole."""
        return self._share.get(shape) if isinstance(shape, Mesh) else None

    @property
    def any_seen(self) -> bool:
        """True where a visual shape is drawn."""
        return any(rgba[3] > 0.0 for placed in self.visuals.values() for _, rgba, _ in placed)

    @property
    def notes(self) -> tuple[str, ...]:
        """Shapes that cannot be drawn, and what is drawn instead, one sentence each."""
        faults = _grouped(self._faults)
        drawn, whole = self._reduced
        if drawn < whole:
            faults.append(
                f"{self.model.name} is drawn with {drawn} of the {whole} triangles of its meshes, for a "
                "machine without a graphics processor; whole_meshes=True (--whole-meshes) draws all"
            )
        if self._lacks_collisions and self.any_seen:
            faults.append(f"{self.model.name} has no collision shapes that can be shown")
        if self.any_seen or faults:
            return tuple(faults)
        return (f"{self.model.name} has no shapes; it is drawn as lines between its frames",)

    @cached_property
    def colliding_model(self) -> Model:
        """The robot with its collision shapes instead of the visual ones."""
        red, green, blue = (value / 255.0 for value in ORANGE)
        links = [link.name for link in self.model.links]
        geometry = colliding_geometry(self.model.geometry, links, (red, green, blue, 1.0))
        return replace(self.model, geometry=geometry)

    def collisions(self) -> dict[str, list[tuple[Triangles, Floats, bool]]]:
        """Return the collision shapes of each link of which all can be read, with their poses in the link,
        and whether they are flat between edges."""
        found = {link.name: self._colliding_shapes(link.name) for link in self.model.links}
        self._lacks_collisions = not any(found.values())
        return found

    def _visible_shapes(self, link: str) -> list[tuple[Shape, Colour, Floats]]:
        """Return the shapes by which a link is drawn, without those that cannot be read."""
        drawn = list(link_shapes(self.model.geometry, link))
        geometry = self.model.geometry
        self._note_fault(geometry.visuals, link)
        if not drawn and link not in self._faults:
            self._note_fault(geometry.collisions, link)
        return drawn

    def _note_fault(self, shapes_of: Callable[[str], Sequence[Visual | Collision]], link: str) -> None:
        """Keep the reason why shapes of a link cannot be read, if there is one."""
        try:
            for each in shapes_of(link):
                _readable(each.shape)
                self._faults[link] = [*self._faults.get(link, ()), *look_notes(each)]
        except DynxError as error:
            self._faults.setdefault(link, []).append(str(error))

    def _shares(self, shapes: Iterable[Shape]) -> dict[Mesh, int]:
        count = Counter(shape for shape in shapes if isinstance(shape, Mesh))
        if self._look.triangles is None:
            return {}
        parts = budgets({mesh: self._copies * n for mesh, n in count.items()}, self._look.triangles)
        self._reduced = (
            sum(len(reduced(mesh, parts[mesh]).faces) * n for mesh, n in count.items()),
            sum(len(mesh.triangles[1]) * n for mesh, n in count.items()),
        )
        return {mesh: part for mesh, part in parts.items() if part < len(mesh.triangles[1])}

    def _colliding_shapes(self, link: str) -> list[tuple[Triangles, Floats, bool]]:
        try:
            return [
                (hull_of(each.shape), each.origin.matrix, isinstance(each.shape, Mesh))
                for each in self.model.geometry.collisions(link)
            ]
        except DynxError as error:
            self._faults.setdefault(link, []).append(str(error))
            return []


class DrawnRobot(DrawnParts):
    """A robot on the page, at a configuration; each link is a node that carries its shapes.

    Nodes are named by numbers: a name from a file could contain a slash, which separates nodes.
    """

    def __init__(self, scene: Any, path: str, model: Model, look: Look = AS_DESCRIBED) -> None:
        """`scene` is that of a viser server, and `path` the node of the robot, such as ``/robot``."""
        self.model = model
        self._scene, self._path, self._look = scene, path, look
        root = scene.add_frame(path, show_axes=False)
        self.above = {joint.child: joint.parent for joint in model.joints}
        """The parent of each link that has one."""
        self.links = dict[str, Any]()
        """The node of each link, below that of its parent."""
        for link in _parents_first(model):
            over = self.links[self.above[link]].name if link in self.above else path
            self.links[link] = scene.add_frame(f"{over}/link{len(self.links)}", show_axes=False)
        self.fixed = {joint.child: joint.parent for joint in model.joints if not joint.moves}
        """The parent of each link that a fixed joint connects to it."""
        super().__init__(scene, root, self.links, self.above, {model.name: model.root}, self.fixed)
        self._shapes = RobotShapes(model, look)
        self.visuals = {}
        self._collisions: dict[str, list[Any]] | None = None
        self._shows = True, False
        """Whether visual and collision shapes are shown."""
        self._add_visuals()
        self.move(model.neutral())

    def move(self, q: Floats) -> None:
        """Place the links at the configuration q (nq,)."""
        self.place(dict(link_poses(self.model, q)))

    def named(self, name: str) -> list[str]:
        return list(self.parts) if name == self.model.name and name not in self.parts else super().named(name)

    @property
    def notes(self) -> tuple[str, ...]:
        """Shapes that cannot be drawn, and what is drawn instead, one sentence each."""
        return self._shapes.notes

    @property
    def seen_model(self) -> Model:
        """The robot as pictures show it: with its collision shapes where they alone are shown."""
        return self._shapes.colliding_model if self._shows == (False, True) else self.model

    def show(self, *, visuals: bool, collisions: bool) -> None:
        """Show or hide the visual shapes and the collision shapes."""
        self._shows = visuals, collisions
        if collisions and self._collisions is None:
            self._collisions = self._add_collisions()
        for name in self.links:
            self._show_link(name)

    def set_visible(self, name: str, visible: bool) -> None:
        super().set_visible(name, visible)
        self._show_link(name)

    def _show_link(self, name: str) -> None:
        visuals, collisions = (each and name not in self.hidden for each in self._shows)
        for node in self.visuals.get(name, ()):
            node.visible = visuals
        for node in (self._collisions or {}).get(name, ()):
            node.visible = collisions

    def _add_visuals(self) -> None:
        if not any(self._shapes.visuals.values()):
            self._add_sticks()
        for name, placed in self._shapes.visuals.items():
            nodes = self.visuals[name] = []
            for k, (shape, rgba, T) in enumerate(placed):
                if rgba[3] == 0.0:
                    continue
                path = _path_below(self.links[name], "visual", k, shape)
                budget = self._shapes.budget(shape)
                nodes.append(_add_shape(self._scene, path, shape, rgba, T, self._look, budget))

    def _add_sticks(self) -> None:
        """Draw a robot without shapes as lines from each link frame to the frames of its children."""
        size = size_of(self.model)
        for k, joint in enumerate(self.model.joints):
            end = joint.origin.matrix[:3, 3]
            parent = self.links[joint.parent].name
            segment = np.array([[[0.0, 0.0, 0.0], end]], dtype=np.float32)
            colour = self._look.colour or ORANGE
            self._scene.add_line_segments(f"{parent}/stick{k}", segment, colour, thickness=0.03 * size)

    def _add_collisions(self) -> dict[str, list[Any]]:
        return {
            link: [
                add_triangles(
                    self._scene,
                    f"{self.links[link].name}/collision{k}",
                    triangles,
                    T,
                    ORANGE,
                    COLLISION_OPACITY,
                    flat=flat,
                )
                for k, (triangles, T, flat) in enumerate(shapes)
            ]
            for link, shapes in self._shapes.collisions().items()
        }


def _parents_first(model: Model) -> list[str]:
    """Return the names of the links, each after its parent."""
    children: dict[str, list[str]] = {}
    for joint in model.joints:
        children.setdefault(joint.parent, []).append(joint.child)
    under = {joint.child for joint in model.joints}
    ordered = [link.name for link in model.links if link.name not in under]
    for name in ordered:
        ordered += children.get(name, ())
    return ordered


def _grouped(faults: Mapping[str, list[str]]) -> list[str]:
    """Return the faults of links, one sentence each; those that end alike are one."""
    links: dict[str, list[str]] = {}
    for link, messages in faults.items():
        for message in messages:
            named = links.setdefault(message.rpartition(": ")[2], [])
            if link not in named:
                named.append(link)
    grouped = []
    for reason, names in links.items():
        if len(names) == 1:
            grouped += [f"{names[0]}: {m}" for m in faults[names[0]] if m.rpartition(": ")[2] == reason]
        else:
            some = ", ".join(names[:3]) + (", ..." if len(names) > 3 else "")
            grouped.append(f"shapes of {len(names)} links ({some}) are not drawn: {reason}")
    return grouped


def _readable(shape: Shape) -> Shape:
    """Return a shape; DescriptionError for a mesh that cannot be read."""
    if isinstance(shape, Mesh):
        _ = shape.triangles
    return shape


def is_painted(shape: Shape) -> bool:
    """Check whether the colour of a shape changes from place to place."""
    return isinstance(shape, Mesh) and not (shape.surface.texture is None and shape.surface.colours is None)


def _path_below(node: Any, kind: str, k: int, shape: Shape) -> str:
    """Return the path of the node of the shape with the number `k` of a part; the page finds planes by it."""
    return f"{node.name}/{'plane' if isinstance(shape, Plane) else kind}{k}"


def _add_shape(
    scene: Any, path: str, shape: Shape, rgba: Colour, T: Floats, look: Look, budget: int | None
) -> Any:
    """Add a node with a shape at the pose T (4, 4) in its parent, reduced to a `budget` of triangles, and
    return it."""
    rgba = look.scenery.own_colour(shape, rgba)
    opacity = look.opacity or rgba[3]
    if is_painted(shape) and look.colour is None:
        assert isinstance(shape, Mesh)
        content, triangles = glb(reduced_surface(shape, budget), (*rgba[:3], opacity))
        placed = {"wxyz": wxyz(T[:3, :3]), "position": T[:3, 3]}
        node = scene.add_glb(path, content, cast_shadow=False, receive_shadow=False, **placed)
        return PaintedNode(node, triangles)
    triangles, flat = with_edges(shape, budget)
    colour = look.colour or rgb_of(rgba)
    alpha = None if opacity == 1.0 else opacity
    return add_triangles(scene, path, resized(triangles, look.size), T, colour, alpha, flat=flat)


def add_triangles(
    scene: Any, path: str, triangles: Triangles, T: Floats, colour: RGB, opacity: float | None, *, flat: bool
) -> Any:
    """Add a node with triangles at the pose T (4, 4) in its parent, and return it."""
    triangles, side = _with_side(triangles)
    return scene.add_mesh_simple(
        path,
        triangles.vertices,
        triangles.faces,
        color=colour,
        opacity=opacity,
        flat_shading=flat,
        side=side,
        cast_shadow=False,
        receive_shadow=False,
        wxyz=wxyz(T[:3, :3]),
        position=T[:3, 3],
    )


def _with_side(triangles: Triangles) -> tuple[Triangles, str]:
    """Return triangles turned outwards, and the side from which they are drawn, as viser calls it."""
    # The triangles of many files are turned inside out, so they are drawn from both sides, which takes a
    # third more time in software.
    outwards = turned_outwards(triangles) if len(triangles.faces) <= TRIANGLE_BUDGET else None
    return (triangles, "double") if outwards is None else (outwards, "front")


def _add_copies(
    scene: Any, path: str, triangles: Triangles, colour: RGB, opacity: float | None, count: int, *, flat: bool
) -> CopiedShape:
    """Add a node with triangles, in the frame of their link, that is shown `count` times."""
    triangles, side = _with_side(triangles)
    node = scene.add_batched_meshes_simple(
        path,
        triangles.vertices,
        triangles.faces,
        np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        np.zeros((count, 3)),
        batched_colors=(255, 255, 255),
        lod="off",
        opacity=opacity,
        flat_shading=flat,
        side=side,
        cast_shadow=False,
        receive_shadow=False,
    )
    red, green, blue = light_of(np.array(colour) / 255.0).tolist()
    return CopiedShape(node, triangles, count, (red, green, blue))


def _add_copied_shape(
    scene: Any, path: str, shape: Shape, rgba: Colour, T: Floats, look: Look, budget: int | None, count: int
) -> CopiedShape:
    """Add a node with a shape at the pose T (4, 4) in its link, reduced to a `budget` of triangles, that is
    shown `count` times."""
    rgba = look.scenery.own_colour(shape, rgba)
    opacity = look.opacity or rgba[3]
    if is_painted(shape) and look.colour is None:
        assert isinstance(shape, Mesh)
        surface = reduced_surface(shape, budget)
        surface = surface._replace(vertices=surface.vertices @ T[:3, :3].T + T[:3, 3])
        content, triangles = glb(surface, (*rgba[:3], opacity))
        poses = np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)), np.zeros((count, 3))
        node = scene.add_batched_glb(
            path, content, *poses, lod="off", cast_shadow=False, receive_shadow=False
        )
        return CopiedShape(node, triangles, count, None)
    triangles, flat = with_edges(shape, budget)
    triangles = _in_link(resized(triangles, look.size), T)
    alpha = None if opacity == 1.0 else opacity
    return _add_copies(scene, path, triangles, look.colour or rgb_of(rgba), alpha, count, flat=flat)


def _in_link(triangles: Triangles, T: Floats) -> Triangles:
    """Return triangles that are placed at the pose T (4, 4)."""
    return Triangles.of(triangles.vertices @ T[:3, :3].T + T[:3, 3], triangles.faces)


def rgb_of(rgba: Colour) -> RGB:
    """Return a colour of a description as three numbers from 0 to 255."""
    return (round(255 * rgba[0]), round(255 * rgba[1]), round(255 * rgba[2]))


def size_of(model: Model) -> float:
    """Return a length [m] to which marks are scaled: the diagonal of the box around the joints, or 0.3."""
    origins = np.array([T[:3, 3] for _, T in link_poses(model, model.neutral())])
    extent = float(np.linalg.norm(origins.max(axis=0) - origins.min(axis=0)))
    return extent if extent > 0.0 else 0.3


MIN_COPIES = 8
"""Number of robots with one description from which they are drawn as copies."""


class CopiedRobots:
    """Robots with one description: each of their shapes is one node of the page, however many there are."""

    def __init__(self, scene: Any, path: str, model: Model, names: Sequence[str], look: Look) -> None:
        """`names` are those of the robots, and `path` the node of everything drawn here."""
        self._scene, self.path, self.names = scene, path, tuple(names)
        self.model = model
        scene.add_frame(path, show_axes=False)
        self._shapes = RobotShapes(model, look, len(names))
        self._collisions: dict[str, list[CopiedShape]] | None = None
        self._shows = True, False
        self._visuals: dict[str, list[CopiedShape]] = {}
        for link, placed in self._shapes.visuals.items():
            self._visuals[link] = []
            for k, (shape, rgba, T) in enumerate(placed):
                if rgba[3] > 0.0:
                    path, budget = self._path_of(link, "visual", k), self._shapes.budget(shape)
                    copied = _add_copied_shape(scene, path, shape, rgba, T, look, budget, len(names))
                    self._visuals[link].append(copied)

    def _path_of(self, link: str, kind: str, k: int) -> str:
        return f"{self.path}/link{list(self._shapes.visuals).index(link)}/{kind}{k}"

    @property
    def notes(self) -> tuple[str, ...]:
        """Shapes that cannot be drawn, and what is not shown of copies, one sentence each."""
        painted = {link for link, shapes in self._visuals.items() if any(s.colour is None for s in shapes)}
        if not painted:
            return self._shapes.notes
        some = ", ".join(sorted(painted)[:3])
        hint = f"{self.model.name}: copies of links with images or colours of vertices ({some}) stay opaque"
        return (*self._shapes.notes, hint)

    @property
    def seen_model(self) -> Model:
        """The robot as pictures show it: with its collision shapes where they are shown."""
        return self._shapes.colliding_model if self._shows[1] else self.model

    def copied(self) -> dict[CopiedShape, list[str]]:
        """Return the visual shapes with the names of the parts that they show."""
        return self._parts_of(self._visuals)

    def visuals(self) -> dict[str, list[Any]]:
        """Return the visual shapes of each part."""
        return {
            f"{robot}/{link}": [shape.copies[k] for shape in shapes]
            for k, robot in enumerate(self.names)
            for link, shapes in self._visuals.items()
        }

    def show(self, hidden: set[str], *, visuals: bool, collisions: bool) -> dict[CopiedShape, list[str]]:
        """Show or hide the visual shapes and the collision shapes; return the shapes that are new, with the
        names of the parts that they show. Parts that are `hidden` stay so."""
        self._shows, added = (visuals, collisions), {}
        if collisions and self._collisions is None:
            self._collisions = {
                link: [
                    _add_copies(
                        self._scene,
                        self._path_of(link, "collision", k),
                        _in_link(triangles, T),
                        ORANGE,
                        COLLISION_OPACITY,
                        len(self.names),
                        flat=flat,
                    )
                    for k, (triangles, T, flat) in enumerate(shapes)
                ]
                for link, shapes in self._shapes.collisions().items()
            }
            added = self._parts_of(self._collisions)
            for name in hidden:
                self.set_visible(name, False)
        for shapes, seen in ((self._visuals, visuals), (self._collisions or {}, collisions)):
            for each in (shape for of_link in shapes.values() for shape in of_link):
                each.node.visible = seen
        return added

    def set_visible(self, name: str, visible: bool) -> None:
        """Show or hide the collision shapes of a part."""
        for k, robot in enumerate(self.names):
            link = name.removeprefix(f"{robot}/")
            for shape in (self._collisions or {}).get(link, ()) if link != name else ():
                shape.show(k, visible)

    def _parts_of(self, shapes: Mapping[str, Sequence[CopiedShape]]) -> dict[CopiedShape, list[str]]:
        return {
            shape: [f"{robot}/{link}" for robot in self.names] for link, of in shapes.items() for shape in of
        }


class DrawnScene(DrawnParts):
    """Robots by name and bodies; a part is a body, or a link as ``robot/link``.

    Robots with one description are drawn as copies where there are `MIN_COPIES` of them: with the drawing
    calls of one, and without marks.
    """

    def __init__(
        self,
        scene: Any,
        path: str,
        robots: Mapping[str, Model],
        bodies: Iterable[SceneBody] = (),
        look: Look = AS_DESCRIBED,
    ) -> None:
        """`scene` is that of a viser server, and `path` the node of everything drawn here."""
        bodies = tuple(bodies)
        root = scene.add_frame(path, show_axes=False)
        alike: dict[tuple[Model, int], list[str]] = {}
        for name, model in robots.items():
            # A robot without shapes is drawn as lines, which are not copied.
            if any(True for link in model.links for _ in link_shapes(model.geometry, link.name)):
                alike.setdefault((model, id(model.geometry)), []).append(name)
        self.copies = [
            CopiedRobots(scene, f"{path}/copies{k}", model, names, look)
            for k, ((model, _), names) in enumerate(alike.items())
            if len(names) >= MIN_COPIES
        ]
        """The robots that are drawn as copies."""
        copied = {name: copies for copies in self.copies for name in copies.names}
        self.robots = {
            name: DrawnRobot(scene, f"{path}/robot{k}", model, look)
            for k, (name, model) in enumerate(robots.items())
            if name not in copied
        }
        """The other robots by name."""
        parts: dict[str, Any] = {
            f"{robot}/{link}": node
            for robot, drawn in self.robots.items()
            for link, node in drawn.links.items()
        }
        parts |= {
            f"{name}/{link.name}": None for name, copies in copied.items() for link in copies.model.links
        }
        faults = [
            fault if fault.startswith(f"{name} ") else f"{name}: {fault}"
            for name, drawn in self.robots.items()
            for fault in drawn.notes
        ]
        faults += [fault for copies in self.copies for fault in copies.notes]
        start = {
            f"{robot}/{link}": drawn.pose(link)
            for robot, drawn in self.robots.items()
            for link in drawn.links
        }
        for copies in self.copies:
            poses = dict(link_poses(copies.model, copies.model.neutral()))
            start |= {f"{name}/{link}": T for name in copies.names for link, T in poses.items()}
        self._bodies: dict[str, list[Any]] = {}
        for k, body in enumerate(bodies):
            node = parts[body.name] = scene.add_frame(f"{path}/body{k}", show_axes=False)
            self._bodies[body.name] = []
            try:
                self._bodies[body.name] = list(_add_body(scene, node, body, look))
                for each in body.visuals or body.shapes:
                    faults += [f"{body.name}: {note}" for note in look_notes(each)]
            except DynxError as error:
                faults.append(f"{body.name}: {error}")
            start[body.name] = body.pose.matrix
        above, rigid = (
            {
                f"{robot}/{link}": f"{robot}/{parent}"
                for robot, drawn in self.robots.items()
                for link, parent in getattr(drawn, kind).items()
            }
            for kind in ("above", "fixed")
        )
        rigid |= {
            f"{name}/{joint.child}": f"{name}/{joint.parent}"
            for name, copies in copied.items()
            for joint in copies.model.joints
            if not joint.moves
        }
        roots = {robot: f"{robot}/{model.root}" for robot, model in robots.items()}
        shapes = {shape: names for copies in self.copies for shape, names in copies.copied().items()}
        super().__init__(scene, root, parts, above, roots, rigid, shapes)
        self.grounds = frozenset(body.name for body in bodies if has_ground([body]))
        self.visuals = self._bodies | {
            f"{name}/{link}": nodes
            for name, robot in self.robots.items()
            for link, nodes in robot.visuals.items()
        }
        for copies in self.copies:
            self.visuals |= copies.visuals()
        self.place(start)
        self.faults = tuple(faults)
        """Shapes that cannot be drawn, one sentence each."""

    @property
    def listed(self) -> tuple[str, ...]:
        copied = {name: copies.model for copies in self.copies for name in copies.names}
        links = {f"{name}/{link.name}" for name, model in copied.items() for link in model.links}
        roots = {self.roots[name] for name in copied}
        return tuple(name for name in self.parts if name not in links or name in roots)

    @property
    def choices(self) -> tuple[str, ...]:
        robots = {self.roots[name]: name for copies in self.copies for name in copies.names}
        return tuple(robots.get(part, part) for part in self.listed)

    def set_visible(self, name: str, visible: bool) -> None:
        super().set_visible(name, visible)
        for copies in self.copies:
            copies.set_visible(name, visible)
        for robot, drawn in self.robots.items():
            link = name.removeprefix(f"{robot}/")
            if link != name and link in drawn.links:
                drawn.set_visible(link, visible)

    @property
    def seen_models(self) -> dict[str, Model]:
        """The robots as pictures show them: with their collision shapes where these are shown."""
        models = {name: robot.seen_model for name, robot in self.robots.items()}
        return models | {name: copies.seen_model for copies in self.copies for name in copies.names}

    def show(self, *, visuals: bool, collisions: bool) -> None:
        """Show or hide the visual shapes and the collision shapes of the robots."""
        for robot in self.robots.values():
            robot.show(visuals=visuals, collisions=collisions)
        for copies in self.copies:
            added = copies.show(self.hidden, visuals=visuals, collisions=collisions)
            if added:
                self._add_copied(added)


def _add_body(scene: Any, node: Any, body: SceneBody, look: Look) -> Iterator[Any]:
    for k, (shape, rgba, T) in enumerate(body.drawn_shapes()):
        yield _add_shape(scene, _path_below(node, "shape", k, shape), shape, rgba, T, look, look.triangles)


THICKNESS = 0.009
"""Radius of the shafts of contact forces, as a share of the size of what is shown."""


class ContactArrows:
    """An arrow for each contact, along its force, at its point; the scale is fixed, in metres a newton."""

    MAX_NUMBERS = 24
    """Largest number of forces whose numbers are shown, the largest ones."""

    def __init__(self, scene: Any, metres_per_newton: float, thickness: float) -> None:
        self._scene, self._scale, self._thickness = scene, metres_per_newton, thickness
        self._node: Any = None
        self.shown = True
        """True while the arrows are shown."""
        self._labels: list[Any] = []
        self.numbers_shown = False
        """True while each arrow has its force in newtons at its tip."""
        self._points: Any = None
        self.points_shown = False
        """True while the points are shown, also those without a force."""

    def put(self, points: Floats, forces: Floats) -> None:
        """Show forces (m, 3) [N] at points (m, 3) [m], in world axes."""
        self._put_points(points if self.points_shown else points[:0])
        self._put_numbers(points, forces if self.shown and self.numbers_shown else forces[:0])
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

    def _put_numbers(self, points: Floats, forces: Floats) -> None:
        sizes = np.linalg.norm(forces, axis=1)
        order = [k for k in np.argsort(-sizes)[: self.MAX_NUMBERS].tolist() if sizes[k] > 0.0]
        while len(self._labels) < len(order):
            self._labels.append(self._scene.add_label(f"/contact_force{len(self._labels)}", ""))
        for label, k in zip(self._labels, order, strict=False):
            label.text, label.visible = f"{sizes[k]:.3g} N", True
            label.position = points[k] + self._scale * forces[k]
        for label in self._labels[len(order) :]:
            label.visible = False

    def _put_points(self, points: Floats) -> None:
        if self._points is None and len(points):
            self._points = self._scene.add_point_cloud(
                "/contact_points",
                points.astype(np.float32),
                YELLOW,
                point_size=3.0 * self._thickness,
                point_shape="circle",
                precision="float32",
            )
        elif self._points is not None:
            self._points.visible = bool(len(points))
            if len(points):
                self._points.points = points.astype(np.float32)
