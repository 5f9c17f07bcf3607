"""Robots and bodies of a scene in Bullet: loaded from canonical URDF, placed, pushed and read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dynx.engines.decimal_point import decimal_point
from dynx.engines.pybullet.canonical_urdf import (
    Attachments,
    BulletTree,
    body_name,
    bullet_tree,
    fixed_link,
    write_bullet_urdf,
)
from dynx.engines.pybullet.connection import Reals
from dynx.engines.pybullet.inertia import Ballast
from dynx.engines.pybullet.root_frame import BaseState, RootFrame
from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.shapes import ShapeFiles
from dynx.errors import EngineError, EngineLimitError
from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.steppers.layout import Collider

MAX_LINKS = 121
"""Largest number of links of a robot besides its root: Bullet reports the states of no more."""

IMPLICIT_CYLINDER = 128
"""Bullet's flag URDF_USE_IMPLICIT_CYLINDER, without which a cylinder becomes a prism."""

UNLIMITED = 1e30
"""Limit of a joint that is limited in the other direction only."""

FREE = {"linearDamping": 0.0, "angularDamping": 0.0, "maxJointVelocity": 1e300}
"""Options of `changeDynamics` without which Bullet damps the base and limits speeds."""


class BulletObject:
    """A tree of links in a Bullet world, with the shapes of its colliders."""

    def __init__(
        self,
        client: WorldClient,
        mechanism: Mechanism,
        colliders: Mapping[int, Collider],
        files: ShapeFiles,
        folder: Path,
        limits: Mapping[int, tuple[float, float]],
    ) -> None:
        """`mechanism` is in long double; `colliders` are those of the object, by number.

        Raises EngineLimitError for a mechanism that Bullet's stepper cannot represent.
        """
        self.client = client
        name = mechanism.name
        tree = bullet_tree(mechanism, (Ballast(),) * (1 + len(mechanism.bodies)), 0, unit=1.0)
        _require_inertias(name, tree)
        self.floating = tree.floating
        self.root = RootFrame(tree.root)
        attachments, names = _attach(tree, colliders, files, limits)
        more = sum(link.startswith("s") for link in names.values())
        if len(tree.links) + more > MAX_LINKS:
            raise EngineLimitError(
                f"{name} has {len(tree.links)} moving joints, and {more} links with shapes that are fixed to "
                f"others; Bullet supports at most {MAX_LINKS} of both together"
            )
        engine = client.engine
        path = folder / "object.urdf"
        # A new file: one that is overwritten is flushed to the disk, which takes 10 ms on some file systems.
        path.unlink(missing_ok=True)
        path.write_text(write_bullet_urdf(tree, attachments), encoding="ascii")
        flags = engine.URDF_USE_INERTIA_FROM_FILE | engine.URDF_USE_SELF_COLLISION | IMPLICIT_CYLINDER
        flags |= files.flags
        with decimal_point():
            self.body = int(
                client.call(engine.loadURDF, str(path), useFixedBase=not tree.floating, flags=flags)
            )
        self._inertias = [tree.root, *(link.inertia for link in tree.links)]
        self._number_links(name, tree, names)
        self._set_dynamics(tree)

    def _number_links(self, name: str, tree: BulletTree, names: Mapping[int, str]) -> None:
        """Look up Bullet's numbers of the joints and of the links with shapes."""
        engine, call = self.client.engine, self.client.call
        infos = [call(engine.getJointInfo, self.body, k) for k in range(call(engine.getNumJoints, self.body))]
        found = {info[12].decode("ascii"): info[0] for info in infos}
        self.links = [found.get(f"l{k}", ROOT) for k in range(len(tree.links))]
        self.link_of = {number: ROOT if link == "b" else found[link] for number, link in names.items()}
        if ROOT in self.links:
            raise EngineError(f"Bullet has not read every link of {name}")

    def _set_dynamics(self, tree: BulletTree) -> None:
        engine, call = self.client.engine, self.client.call
        call(engine.changeDynamics, self.body, ROOT, **FREE)
        if tree.floating:
            moments = tree.root.moments.tolist()
            call(engine.changeDynamics, self.body, ROOT, localInertiaDiagonal=moments)
        for link, k in zip(tree.links, self.links, strict=True):
            moments = link.inertia.moments.tolist()
            call(engine.changeDynamics, self.body, k, localInertiaDiagonal=moments)
            call(engine.changeDynamics, self.body, k, jointDamping=0.0)
        for inertia, k in zip(self._inertias, [ROOT, *self.links], strict=True):
            info = call(engine.getDynamicsInfo, self.body, k)
            if (k != ROOT or tree.floating) and (
                info[0] != inertia.mass or list(info[2]) != inertia.moments.tolist()
            ):
                raise EngineError(f"Bullet has not read the inertia of link {k} as it was written")

    def inertial_frame(self, body: int) -> Floats:
        """Return the pose (4, 4) of the inertial frame of a moving body, or of the root, in its own frame."""
        inertia = self._inertias[body + 1]
        return np.asarray(homogeneous(inertia.axes, inertia.center), dtype=np.float64)

    # -- state --------------------------------------------------------------------------------

    def place_base(self, base: BaseState) -> None:
        """Set the state of the root's inertial frame."""
        engine, call = self.client.engine, self.client.call
        call(engine.resetBasePositionAndOrientation, self.body, base.position, base.quat_xyzw)
        call(engine.resetBaseVelocity, self.body, base.linear, base.angular)

    def place_joints(self, positions: Reals, rates: Reals) -> None:
        """Set the state of all joints of the tree."""
        if positions:
            self.client.call(
                self.client.engine.resetJointStatesMultiDof,
                self.body,
                self.links,
                [[x] for x in positions],
                [[x] for x in rates],
            )

    def base_state(self) -> BaseState:
        """Return the state of the root's inertial frame."""
        engine, call = self.client.engine, self.client.call
        position, quat = call(engine.getBasePositionAndOrientation, self.body)
        linear, angular = call(engine.getBaseVelocity, self.body)
        return BaseState(position, quat, linear, angular)

    def joint_states(self) -> tuple[Reals, Reals]:
        """Return the positions and the rates of all joints of the tree."""
        if not self.links:
            return [], []
        states = self.client.call(self.client.engine.getJointStates, self.body, self.links)
        return [state[0] for state in states], [state[1] for state in states]

    def push_base(self, force: Reals, moment: Reals) -> None:
        """Apply a force at the centre of mass of the root and a moment, along the axes of the world, during
        the next step."""
        engine, call = self.client.engine, self.client.call
        frame = engine.WORLD_FRAME
        at = call(engine.getBasePositionAndOrientation, self.body)[0]
        call(engine.applyExternalForce, self.body, ROOT, force, at, frame)
        call(engine.applyExternalTorque, self.body, ROOT, moment, frame)


def _require_inertias(name: str, tree: BulletTree) -> None:
    bodies = [link.inertia for link in tree.links]
    if tree.floating and not tree.root.mass > 0.0:
        raise EngineLimitError(
            f"the base of {name} floats and has no mass, which Bullet would fix to the world; give its "
            "root link an <inertial>, or choose another engine"
        )
    for body in [tree.root, *bodies]:
        if body.mass < 0.0 or body.moments.min() < 0.0:
            raise EngineLimitError(
                f"{name} has an inertia that Bullet's stepper does not accept (see dynx doctor); another "
                "engine may"
            )


def _attach(
    tree: BulletTree,
    colliders: Mapping[int, Collider],
    files: ShapeFiles,
    limits: Mapping[int, tuple[float, float]],
) -> tuple[Attachments, dict[int, str]]:
    """Return the shapes as elements, and the name of the link that has those of each collider.

    Contacts are reported by link, so that the second and later colliders of a moving body get links of their
    own, without mass and fixed to the body; they do not change the motion.
    """
    root = np.linalg.inv(homogeneous(tree.root.axes, tree.root.center).astype(np.float64))
    shapes: dict[int, Sequence[str]] = {}
    names: dict[int, str] = {}
    extra: list[str] = []
    for number, collider in colliders.items():
        body = collider.owner.body if collider.owner.robot is not None else ROOT
        elements = files.elements(collider.shapes, root if body == ROOT else np.eye(4))
        if not elements:
            continue
        if body not in shapes:
            names[number], shapes[body] = body_name(body), elements
            continue
        names[number] = f"s{number}"
        extra += fixed_link(names[number], body_name(body), elements)
    if extra and not tree.floating:
        # Of a fixed base, Bullet takes a link that is fixed to link 0 for a part of the world.
        extra = [*fixed_link("d", "b", ()), *extra]
    return Attachments(tuple(extra), shapes, limits), names
