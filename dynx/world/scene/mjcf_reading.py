"""Scenes of MJCF: each tree of bodies is a robot or a body, with the contacts and constraints of the file.

A tree with a joint is a robot, whose base is fixed unless its first body has a free joint. A single body
that moves freely is a body of the scene; so is each body that is fixed in the world, and each geom of the
world. What a scene cannot say is an error with the line, or a note of the scene. No part of MuJoCo is needed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath

import numpy as np

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.elements import Inertial, Mimic, Note, Pose, Vector
from dynx.model.geometry import LinkGeometry
from dynx.model.loading import build_described
from dynx.model.mjcf.keyframes import TreeState, position_and_quaternion, read_keyframes, tree_states
from dynx.model.mjcf.reader import MjcfBody, MjcfTree, MjcfTrees, read_trees
from dynx.model.mjcf.shapes import Geom
from dynx.model.named_configurations import coordinates_of
from dynx.model.package_search import StrPath
from dynx.model.stated_parts import NamedConfiguration
from dynx.model.xml.reading import Element
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat
from dynx.world.scene.bodies import Constraint, PointToPoint, SceneBody, Weld
from dynx.world.scene.exported_trees import as_exported
from dynx.world.scene.filters import CollisionFilter
from dynx.world.scene.mjcf_contacts import ContactRules, MjcfCollider
from dynx.world.scene.robots import WORLD, SceneRobot
from dynx.world.scene.scene import Scene

_COUPLED = ("joint1", "joint2")
_NOT_READ = {
    "tendon": "couples tendons",
    "flex": "is of a soft body",
    "flexvert": "is of a soft body",
    "flexstrain": "is of a soft body",
    "distance": "is no longer part of MJCF",
}


def scene_from_mjcf(
    data: str | bytes, source: str, package_dirs: Iterable[StrPath] = (), keyframe: str | None = None
) -> Scene | None:
    """Return the scene of a model in MJCF; None for a document of another format.

    It starts at `qpos0`, at rest, or at the position and velocity of a keyframe of that name. Raises
    DescriptionError for malformed content, UnsupportedFeatureError for what neither a robot nor a scene can
    say, each with file and line; UnknownNameError for another keyframe.
    """
    trees = read_trees(data, source, package_dirs)
    return None if trees is None else _SceneReader(trees, source, keyframe).scene()


@dataclass(frozen=True)
class _BodyPlace:
    """Where a body of the file is in the scene: its part, None for the world, and its pose there (4, 4)."""

    part: str | None
    T_part_body: Floats


class _SceneReader:
    def __init__(self, trees: MjcfTrees, source: str, keyframe: str | None) -> None:
        self._trees, self._source, self._keyframe = trees, source, keyframe
        self._document, self._reading = trees.document, trees.document.reading
        self._robots: list[SceneRobot] = []
        self._bodies: list[SceneBody] = []
        self._colliders: list[MjcfCollider] = []
        self._taken: set[str] = {WORLD}
        self._constraint_names: set[str] = {WORLD}
        self._places: dict[str, _BodyPlace] = {}
        self._originals = {id(body.element): body for tree in trees.trees for body in tree.bodies}
        self._joint_owners: dict[str, int] = {}
        self._kept: dict[str, str] = {}
        self._without_shapes = 0
        self._keys = read_keyframes(trees.document)

    def scene(self) -> Scene:
        trees, reading = self._trees, self._reading
        equalities = list(self._equalities())
        exported = [as_exported(tree) for tree in trees.trees]
        keyframes = self._states_of_keyframes(exported)
        states = self._states(exported) if self._keyframe is None else keyframes[self._keyframe]
        couplings = self._couplings(equalities, exported)
        for geom in trees.world:
            self._add_fixed("ground" if geom.type == "plane" else "geom", None, np.eye(4), [geom])
        for number, (tree, renamed) in enumerate(zip(trees.trees, exported, strict=True)):
            named = [found[number].configuration(name) for name, found in keyframes.items()]
            self._add_tree(renamed, couplings[number], states[number], named)
            self._place_dropped(tree)
        if self._without_shapes:
            reading.note(
                self._document.root,
                f"{_counted(self._without_shapes, 'fixed body', 'fixed bodies')} and geoms of the world that "
                "touch nothing are no part of the scene",
            )
        constraints = [each for element in equalities for each in self._constraints(element)]
        originals = {body.name: body for body in self._originals.values()}
        rules = ContactRules(self._document, originals, self._kept, self._colliders, self._taken)
        self._robots = [
            replace(each, self_collision=rules.touching_inside(each.name)) for each in self._robots
        ]
        own_filter = CollisionFilter(self._robots, self._bodies, [])
        ignored, groups = rules.ignored(own_filter)
        scene = Scene(
            self._free_name(trees.name or PurePath(self._source).name.split(".")[0] or "scene", set()),
            self._robots,
            self._bodies,
            constraints,
            ignored,
            groups,
            trees.gravity,
        )
        rules.note_friction(scene.collision_filter)
        self._note_keyframes()
        return replace(scene, notes=tuple(self._notes()))

    def _notes(self) -> Iterator[Note]:
        """Yield the notes of the scene, each once, with the name of the file."""
        file = PurePath(self._source).name
        others = {source for _, source in self._reading.files.values()}
        for note in dict.fromkeys(self._reading.notes):
            # Those on an included file begin with its path.
            included = note.message.partition(": ")[0] in others
            yield note if included else Note(f"{file}: {note.message}", note.line)

    # -- robots and bodies ----------------------------------------------------------------------

    def _add_tree(
        self,
        tree: MjcfTree,
        couplings: dict[str, Mimic],
        start: TreeState,
        named: Sequence[NamedConfiguration],
    ) -> None:
        moving = any(joint.moves for joint in tree.description.joints)
        if not (moving or tree.free):
            for body in tree.bodies:
                self._add_fixed(body.name, body, body.T_world_body, body.geoms)
        elif tree.free and len(tree.bodies) == 1 and any(geom.collides for geom in tree.first.geoms):
            self._add_free(tree, start)
        else:
            self._add_robot(tree, couplings, start, named)

    def _add_fixed(
        self, name: str, body: MjcfBody | None, T_world_body: Floats, geoms: Sequence[Geom]
    ) -> None:
        """Add what is fixed in the world, one body of the scene for the geoms of one friction."""
        original = None if body is None else self._originals[id(body.element)]
        if original is not None:
            self._places[original.name] = _BodyPlace(None, T_world_body)
        touching: dict[object, list[Geom]] = {}
        for geom in geoms:
            if geom.collides:
                contact = geom.contact
                masks = contact.contype, contact.conaffinity
                key = (contact.acting_friction, contact.condim, contact.priority, masks)
                touching.setdefault(key, []).append(geom)
        if not touching:
            self._without_shapes += 1
            return
        for number, found in enumerate(touching.values()):
            # Shapes that only draw the body belong to its first part.
            drawn = [geom for geom in geoms if not geom.collides] if number == 0 else []
            stated = found[0].name if body is None and found[0].name else name
            part = self._free_name(stated, self._taken)
            collider = MjcfCollider(part, original, tuple(found))
            if original is not None and number == 0:
                self._places[original.name] = _BodyPlace(part, np.eye(4))
            self._add_body(collider, Pose.from_matrix(T_world_body), drawn, None, (0.0,) * 6)

    def _add_free(self, tree: MjcfTree, start: TreeState) -> None:
        body, description = tree.first, tree.description
        original = self._originals[id(body.element)]
        part = self._free_name(body.name, self._taken)
        self._places[original.name] = _BodyPlace(part, np.eye(4))
        touching = tuple(geom for geom in body.geoms if geom.collides)
        drawn = [geom for geom in body.geoms if not geom.collides]
        inertial = description.links[0].inertial or Inertial()
        assert start.T_world_free is not None
        pose = Pose.from_matrix(start.T_world_free)
        self._add_body(MjcfCollider(part, original, touching), pose, drawn, inertial, start.twist.tolist())

    def _add_body(
        self,
        collider: MjcfCollider,
        pose: Pose,
        drawn: Sequence[Geom],
        inertial: Inertial | None,
        twist: Sequence[float],
    ) -> None:
        element = collider.element if collider.body is None else collider.body.element
        # Poses of exported bodies are those of the body around, whose geoms have poses in their own.
        shapes = self._trees.geoms.geometry([*collider.geoms, *drawn])
        if shapes.collision_fault is not None:
            raise shapes.collision_fault
        # A file of a scene has neither names of shapes nor of colours.
        collisions = tuple(replace(each, name="") for each in shapes.collisions)
        visuals = tuple(
            replace(each, name="", material=each.material and replace(each.material, name=""))
            for each in shapes.visuals
        )
        if shapes.visual_fault is not None:
            visuals = ()
            self._reading.note(
                element, f"{shown(collider.part)} is drawn by its shapes: {shapes.visual_fault}"
            )
        material = collider.material
        if _are_seen_in_one_colour(shapes):
            # The shapes are what is seen, in the colour of the body.
            look = visuals[0].material
            visuals = ()
            if look is not None and look.rgba is not None:
                material = replace(material, rgba=look.rgba)
        mass, center, tensor = None, None, None
        if inertial is not None:
            mass, center = inertial.mass, inertial.origin.xyz
            turned = inertial.link_tensor
            tensor = (turned + turned.T) / 2.0
        try:
            made = SceneBody(
                collider.part,
                collisions,
                pose,
                mass,
                tensor,
                center,
                twist,
                material,
                visuals,
            )
        except ArgumentError as error:
            raise self._reading.error(element, str(error)) from None
        self._bodies.append(made)
        self._colliders.append(collider)

    def _add_robot(
        self,
        tree: MjcfTree,
        couplings: dict[str, Mimic],
        start: TreeState,
        named: Sequence[NamedConfiguration],
    ) -> None:
        content = tree.description
        name = self._free_name(content.name or "robot", self._taken)
        joints = [
            replace(joint, mimic=couplings[joint.name]) if joint.name in couplings else joint
            for joint in content.joints
        ]
        content = replace(content, name=name, joints=joints, configurations=tuple(named))
        model = build_described(content, self._source)
        q = coordinates_of(model, start.configuration("start"))
        own = set(model.joint_names)
        v = np.zeros(model.nv)
        if tree.free:
            R = rotation_from_quat(q[3:7])
            v[:3], v[3:6] = R.T @ start.twist[:3], R.T @ start.twist[3:]
        for joint, speed in start.speeds.items():
            if joint in own:
                first = model.coordinate_index(joint)
                v[first : first + len(speed)] = speed
        materials = {}
        found: list[MjcfCollider] = []
        for body in tree.bodies:
            original = self._originals[id(body.element)]
            part = f"{name}/{body.name}"
            self._places[original.name] = _BodyPlace(part, np.eye(4))
            touching = tuple(geom for geom in body.geoms if geom.collides)
            if touching:
                found.append(MjcfCollider(part, original, touching))
                materials[body.name] = found[-1].material
        self._robots.append(SceneRobot(name, model, q, v, materials=materials))
        self._colliders += found

    def _place_dropped(self, tree: MjcfTree) -> None:
        """Place bodies that `as_exported` merges with others on the links that they are fixed to."""
        for body in tree.bodies:
            self._kept.setdefault(body.name, body.name)
            if body.name in self._places:
                continue
            owner = body.name.removesuffix("/shapes")
            kept = next(each for each in tree.bodies[1:] if each.name in (owner, tree.bodies[1].name))
            if owner in self._places:
                kept = next(each for each in tree.bodies if each.name == owner)
            place = self._places[kept.name]
            T = place.T_part_body @ inverse(kept.T_world_body) @ body.T_world_body
            self._places[body.name] = _BodyPlace(place.part, T)
            self._kept[body.name] = kept.name

    def _free_name(self, name: str, taken: set[str]) -> str:
        """Return a name for a part, without the ``/`` that stands between a robot and a link."""
        stem = name.strip("/").replace("/", "_") or "part"
        stem = f"{stem}_part" if stem == WORLD else stem
        free, number = stem, 2
        while free in taken:
            free, number = f"{stem}_{number}", number + 1
        taken.add(free)
        return free

    # -- equality constraints -------------------------------------------------------------------

    def _equalities(self) -> Iterator[Element]:
        """Yield the equality constraints that act, or that a world may switch on."""
        flag = self._document.options.disabled("equality")
        if flag is not None:
            self._reading.note(flag, "equality constraints are disabled, and none is read")
            return
        for element in self._document.sections("equality"):
            resolved = self._document.resolved(element, None, "equality")
            switched = element.tag in ("connect", "weld")
            if not switched and resolved.attributes.get("active", "true") == "false":
                self._reading.note(element, f"<{element.tag}> of <equality> is not active, and is not read")
            else:
                yield resolved

    def _couplings(
        self, equalities: Sequence[Element], exported: Sequence[MjcfTree]
    ) -> dict[int, dict[str, Mimic]]:
        """Return the followers among the joints, by the number of their tree and their name in the robot."""
        reading = self._reading
        short: dict[str, tuple[int, str, float]] = {}
        for number, (tree, renamed) in enumerate(zip(self._trees.trees, exported, strict=True)):
            for (stated, reference), (name, _) in zip(tree.positions, renamed.positions, strict=True):
                short[stated] = (number, name, reference)
        found: dict[int, dict[str, Mimic]] = {number: {} for number in range(len(exported))}
        drivers: set[str] = set()
        followers: set[str] = set()
        for element in equalities:
            if element.tag != "joint":
                continue
            first, second = (element.attributes.get(each) for each in _COUPLED)
            for joint in (first, second):
                if joint is not None and joint not in short:
                    raise reading.error(
                        element,
                        f"<joint> of <equality> names the joint {shown(joint)}{nearest(joint, short)}",
                    )
            what = f"the coupling of joint {shown(first or '')}"
            given = element.attributes
            numbers = (
                reading.some_numbers(element, "polycoef", what, 1, 5) if "polycoef" in given else (0.0, 1.0)
            )
            offset, scale, *higher = (*numbers, *(0.0, 1.0, 0.0, 0.0, 0.0)[len(numbers) :])
            reason = ""
            if first is None or second is None:
                reason = "it holds one joint at a position"
            elif short[first][0] != short[second][0]:
                reason = "its joints are of two robots"
            elif any(higher):
                reason = "it is not linear"
            elif first in followers or first in drivers or second in followers:
                reason = "its joints are coupled already"
            if reason:
                reading.note(element, f"{what} is not read ({reason}): the joint moves freely")
                continue
            assert first is not None
            assert second is not None
            (number, follower, zero), (_, driver, driver_zero) = short[first], short[second]
            drivers.add(second)
            followers.add(first)
            found[number][follower] = Mimic(driver, scale, zero + offset - scale * driver_zero)
        return found

    def _constraints(self, element: Element) -> Iterator[Constraint]:
        """Yield the constraint of an element, which a scene may not have."""
        reading = self._reading
        if element.tag == "joint":
            return
        if element.tag not in ("connect", "weld"):
            reading.note(
                element, f"<{element.tag}> is not read: it {_NOT_READ.get(element.tag, 'is unknown')}"
            )
            return
        what = f"<{element.tag}> of <equality>"
        a, b, T_a, T_b = self._ends(element, what)
        if a == b or (self._is_fixed(a) and self._is_fixed(b)):
            reading.note(
                element, f"{what} connects {shown(a)} and {shown(b)}, rigid already, and is not read"
            )
            return
        name = element.attributes.get("name", "")
        name = self._free_name(name, self._constraint_names) if name else ""
        active = reading.flag(element, "active", what, default=True)
        if element.tag == "weld":
            yield Weld(a, b, Pose.from_matrix(T_a @ inverse(T_b)), name=name, active=active)
            return
        x, y, z = T_a[:3, 3].tolist()
        point: Vector = (x, y, z)
        x, y, z = T_b[:3, 3].tolist()
        yield PointToPoint(a, b, point, (x, y, z), name=name, active=active)

    def _ends(self, element: Element, what: str) -> tuple[str, str, Floats, Floats]:
        """Return the parts that a constraint connects, and the pose (4, 4) in each that coincides."""
        reading, given, sites = self._reading, element.attributes, self._trees.sites
        if "site1" in given or "site2" in given:
            ends = []
            for name in (reading.attribute(element, each, what) for each in ("site1", "site2")):
                if name not in sites:
                    raise reading.error(element, f"{what} names the site {shown(name)}{nearest(name, sites)}")
                part, T = self._place(sites[name].body, element, what)
                ends.append((part, T @ sites[name].T_body_site))
            (a, T_a), (b, T_b) = ends
            return a, b, T_a, T_b
        first, second = reading.attribute(element, "body1", what), given.get("body2", WORLD)
        (a, T_a), (b, T_b) = (
            self._place(None if name == WORLD else name, element, what) for name in (first, second)
        )
        T_1, T_2 = (self._pose_of_body(name) for name in (first, second))
        anchor = reading.vector(element, "anchor", what) if "anchor" in given else (0.0, 0.0, 0.0)
        shift = homogeneous(np.eye(3), np.array(anchor))
        if element.tag == "connect":
            return a, b, T_a @ shift, T_b @ inverse(T_2) @ T_1 @ shift
        relative = (
            np.array(reading.numbers(element, "relpose", what, 7)) if "relpose" in given else np.zeros(7)
        )
        if not relative[3:].any():
            # The pose of the file is kept, and the point of the second body does not matter.
            return a, b, T_a, T_b @ inverse(T_2) @ T_1
        w, x, y, z = relative[3:] / np.linalg.norm(relative[3:])
        R = rotation_from_quat(np.array([x, y, z, w]))
        return a, b, T_a @ homogeneous(R, relative[:3]), T_b @ shift

    def _place(self, body: str | None, element: Element, what: str) -> tuple[str, Floats]:
        """Return the part that a body of the file is in, and its pose there (4, 4)."""
        if body is None:
            return WORLD, np.eye(4)
        if body not in self._places:
            raise self._reading.error(
                element, f"{what} names the body {shown(body)}{nearest(body, self._places)}"
            )
        place = self._places[body]
        return WORLD if place.part is None else place.part, place.T_part_body

    def _pose_of_body(self, name: str) -> Floats:
        if name == WORLD:
            return np.eye(4)
        return next(body.T_world_body for body in self._originals.values() if body.name == name)

    def _is_fixed(self, part: str) -> bool:
        return part == WORLD or CollisionFilter(self._robots, self._bodies, []).is_fixed(part)

    # -- keyframes ------------------------------------------------------------------------------

    def _states_of_keyframes(self, exported: Sequence[MjcfTree]) -> dict[str, list[TreeState]]:
        """Return the states of the trees at each keyframe.

        Keyframes of free bodies that MuJoCo aligns with their principal axes have a note instead, and an
        error where the scene starts at one. Raises UnknownNameError for the start at no keyframe.
        """
        keys, reading = self._keys, self._reading
        start = self._keyframe
        if start is not None and start not in keys:
            known = f"; it has {', '.join(map(shown, list(keys)[:5]))}" if keys else "; it has none"
            raise UnknownNameError(
                f"{reading.source}: no keyframe {shown(start)}{nearest(start, keys) or known}"
            )
        aligned = [tree.first for tree in self._trees.trees if tree.aligned]
        if keys and aligned:
            reason = (
                f"the free joint of body {shown(aligned[0].name)} is aligned with principal axes, for which "
                "dynx does not read"
            )
            if start is not None:
                raise reading.unsupported(aligned[0].element, f"{reason} keyframe {shown(start)}")
            reading.note(aligned[0].element, f"{reason} keyframes")
            return {}
        for attribute in ("act", "ctrl", "mpos", "mquat"):
            if start is not None and attribute in keys[start].attributes:
                reading.note(keys[start], f"{attribute} of keyframe {shown(start)} is not read")
        return {name: self._states(exported, key, name) for name, key in keys.items()}

    def _states(
        self, exported: Sequence[MjcfTree], key: Element | None = None, name: str = ""
    ) -> list[TreeState]:
        """Return the state of each tree at a keyframe; None for `qpos0`, at rest."""
        trees = self._trees.trees
        states = tree_states(self._document, [tree.coordinates for tree in trees], key, name)
        return [_exported_state(*each) for each in zip(states, trees, exported, strict=True)]

    def _note_keyframes(self) -> None:
        if self._keys and self._keyframe is None:
            names = ", ".join(map(shown, list(self._keys)[:5]))
            self._reading.note(
                next(iter(self._keys.values())),
                f"the scene starts at qpos0; keyframe=... starts it at one of the file's: {names}",
            )


def _are_seen_in_one_colour(shapes: LinkGeometry) -> bool:
    """Check whether the shapes that are seen are those that collide, in one colour."""
    drawn = [(each.shape, each.origin) for each in shapes.visuals]
    if not drawn or drawn != [(each.shape, each.origin) for each in shapes.collisions]:
        return False
    return len({None if each.material is None else each.material.rgba for each in shapes.visuals}) == 1


def _counted(count: int, one: str, several: str) -> str:
    return f"{count} {one if count == 1 else several}"


def _exported_state(state: TreeState, tree: MjcfTree, renamed: MjcfTree) -> TreeState:
    """Return the state of a tree in the names, and for the first body, that `as_exported` gave it."""
    if renamed is tree:
        return state
    names = dict(zip(state.positions, (name for name, _ in renamed.positions), strict=True))
    base, twist, T_first = state.base, state.twist, state.T_world_free
    if T_first is not None:
        T = T_first @ inverse(tree.first.T_world_body) @ renamed.first.T_world_body
        arm = T[:3, 3] - T_first[:3, 3]
        base = position_and_quaternion(T)
        twist = np.concatenate([twist[:3] + np.cross(twist[3:], arm), twist[3:]])
    return TreeState(
        base,
        twist,
        {names[joint]: position for joint, position in state.positions.items()},
        {names[joint]: speed for joint, speed in state.speeds.items()},
    )
