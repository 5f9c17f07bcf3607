"""Objects of a scene in Bullet: trees of links with shapes, from canonical URDF; materials and filters.

**Materials.** Bullet multiplies the coefficients of friction and of restitution of two surfaces: given the
square roots, it has the geometric mean. Of torsional and rolling friction it adds that of each surface times
the sliding coefficient of the other, r_a f_b + r_b f_a: with r = y f the sum of y_a and y_b times f_a f_b.

Bullet gives an approach speed v over a gap d the rebound e v - d / dt, and removes in the same step a share
of a penetration. So the contacts of surfaces that rebound are processed once they touch, and their
penetration is removed slowly; then the rebound is e v.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import copysign, nan, sqrt
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.engines.decimal_point import decimal_point
from dynx.engines.pybullet.canonical_urdf import (
    Attachments,
    Ballast,
    BulletTree,
    PrincipalBody,
    body_name,
    bullet_tree,
    fixed_link,
    locale_free,
    pose_element,
    write_bullet_urdf,
)
from dynx.engines.pybullet.client import BulletClient, Reals
from dynx.errors import EngineError, EngineLimitError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Sphere
from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.plain import minus_cross, rotate, rotate_back, rotation_rows
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import cross, quat_from_rotation, quat_product, rotation_from_quat
from dynx.steppers.layout import Collider, Layout, PlacedShape
from dynx.steppers.material import COEFFICIENTS, geometric_means, material_numbers
from dynx.steppers.materials import STRICT_MATERIALS, EffectiveCoefficient, coefficients
from dynx.steppers.mean_coefficients import pair_terms
from dynx.steppers.settings import Setting


class BaseState(NamedTuple):
    """Pose of the root's inertial frame in the world, and its velocity along the world's axes."""

    position: Reals
    quat_xyzw: Reals
    linear: Reals
    angular: Reals


class RootFrame:
    """Conversion between the state of C and the coordinates of a floating base."""

    def __init__(self, root: PrincipalBody) -> None:
        self.center: Floats = np.asarray(root.center, dtype=np.float64)
        """Centre of mass of the root (3,) in the base frame [m]."""
        self.axes: Floats = np.asarray(root.axes, dtype=np.float64)
        """Principal axes of the root (3, 3), in the axes of the base frame."""
        self._axes: Floats = quat_from_rotation(self.axes)
        self._axes_back: Reals = (self._axes * np.array([-1.0, -1.0, -1.0, 1.0])).tolist()
        self._center: Reals = self.center.tolist()

    def base_state(self, q: Floats, v: Floats) -> BaseState:
        """Return the state of C at the first 7 entries of `q` and the first 6 of `v`."""
        R = rotation_from_quat(q[3:7])
        w, c = v[3:6], self.center
        return BaseState(
            (q[:3] + R @ c).tolist(),
            quat_product(q[3:7], self._axes).tolist(),
            (R @ (v[:3] + cross(w, c))).tolist(),
            (R @ w).tolist(),
        )

    def coordinates(self, base: BaseState, near: Reals) -> tuple[Reals, Reals]:
        """Return position and quaternion (7,), and velocity (6,), of the base.

        Of the two quaternions of an attitude, the one nearer to the quaternion `near` is returned.
        """
        quat = self._quaternion(base.quat_xyzw, near)
        R, c = rotation_rows(*quat), self._center
        w, lever = rotate_back(R, base.angular), rotate(R, c)
        linear = minus_cross(rotate_back(R, base.linear), w, c)
        return [*(p - x for p, x in zip(base.position, lever, strict=True)), *quat], [*linear, *w]

    def pose_and_twist(self, base: BaseState) -> tuple[Floats, Floats]:
        """Return the pose (4, 4) of the base frame, and its velocity (6,) in the axes of the world."""
        R = rotation_rows(*self._quaternion(base.quat_xyzw, base.quat_xyzw))
        lever = rotate(R, self._center)
        rows = [[*row, p - x] for row, p, x in zip(R, base.position, lever, strict=True)]
        linear = minus_cross(base.linear, base.angular, lever)
        return np.array([*rows, [0.0, 0.0, 0.0, 1.0]]), np.array([*linear, *base.angular])

    def _quaternion(self, principal: Reals, near: Reals) -> Reals:
        """Return the unit quaternion of the base frame from that of the principal axes."""
        x, y, z, w = principal
        ax, ay, az, aw = self._axes_back
        qx = aw * x + w * ax + y * az - z * ay
        qy = aw * y + w * ay + z * ax - x * az
        qz = aw * z + w * az + x * ay - y * ax
        qw = w * aw - x * ax - y * ay - z * az
        towards = qx * near[0] + qy * near[1] + qz * near[2] + qw * near[3]
        # A quaternion of zeros, of a state that diverged, has no attitude.
        norm = copysign(sqrt(qx * qx + qy * qy + qz * qz + qw * qw), towards) or nan
        return [qx / norm, qy / norm, qz / norm, qw / norm]


SETTINGS = {
    "solver_iterations": Setting(
        100, "largest number of iterations of the constraint solver", least=1, most=1e6
    ),
    "residual_threshold": Setting(1e-7, "squared residual at which the solver stops iterating"),
    "erp": Setting(
        0.2, "share of the error of constraints and joint limits that each step removes", most=1.0
    ),
    "contact_erp": Setting(0.05, "share of a penetration that each step removes", most=1.0),
    "friction_anchors": Setting(
        False,
        "True: the engine pulls sticking contacts back to the point where they formed; this also slows "
        "rolling bodies",
    ),
    "friction_erp": Setting(
        0.2,
        "with `friction_anchors`: share of the drift of a sticking contact that each step removes",
        most=1.0,
        needs=("friction_anchors", (True,)),
    ),
    "cone_friction": Setting(True, "True: a cone limits friction; False: a pyramid limits friction"),
    "restitution_speed": Setting(0.05, "least approach speed [m/s] of an impact that rebounds"),
    "rebound_time_constant": Setting(
        0.2, "time constant [s] at which penetrations between rebounding surfaces vanish", most=1e6
    ),
    "contact_distance": Setting(0.02, "distance [m] below which contact points are kept"),
    "contact_slop": Setting(
        1e-5, "largest depth [m] of a penetration that the solver does not remove", most=1.0
    ),
    "mesh_margin": Setting(
        0.0, "distance [m] by which the hulls of meshes and ellipsoids are enlarged", most=1.0
    ),
    "constraint_force": Setting(
        1e6, "largest force [N] or moment [N m] of welds and point-to-point constraints", most=1e12
    ),
    "link_damping": Setting(
        0.0, "damping [1/s] of the motion of every link and body; Bullet's own default is 0.04"
    ),
    "strict_materials": STRICT_MATERIALS,
}
"""Settings by name."""

PARAMETERS = {
    "solver_iterations": "numSolverIterations",
    "residual_threshold": "solverResidualThreshold",
    "erp": "erp",
    "contact_erp": "contactERP",
    "friction_erp": "frictionERP",
    "cone_friction": "enableConeFriction",
    "restitution_speed": "restitutionVelocityThreshold",
    "contact_distance": "contactBreakingThreshold",
    "contact_slop": "contactSlop",
}
"""Names in `setPhysicsEngineParameter` of the settings that it takes."""


def set_parameters(client: BulletClient, settings: Mapping[str, Any]) -> None:
    """Set the parameters of Bullet's engine."""
    for name, parameter in PARAMETERS.items():
        value = settings[name]
        # One call each: Bullet applies some parameters only where others are absent.
        number = int(value) if isinstance(value, bool) else value
        client.call(client.engine.setPhysicsEngineParameter, **{parameter: number})


MAX_FRICTION = 10.0
"""Largest coefficient of a contact in Bullet, of each kind of friction."""

ADDED = "Bullet adds the coefficients of two surfaces, each times the other's sliding friction"
LIMITED = f"Bullet limits the friction of two surfaces to {MAX_FRICTION:g}"


STIFFNESS = 1e20
"""Stiffness [N/m] of contacts that rebound; from it and the damping Bullet derives the share of a penetration
that it removes in a step."""

REBOUND_GAP = 0.1
"""Gap below which a contact that rebounds is processed, so that bodies at rest keep their contacts in spite
of rounding. Its unit is the distance covered in a step at the least speed that rebounds."""


@dataclass(frozen=True, eq=False)
class BulletMaterials:
    """Bullet's coefficients (n,) of every collider."""

    friction: Floats
    spinning: Floats
    rolling: Floats
    restitution: Floats
    rebounds: NDArray[np.bool_]
    """True for colliders (n,) that rebound from any that they may touch."""

    def options(self, number: int, settings: Mapping[str, Any], dt: float) -> dict[str, float]:
        """Return the options of `changeDynamics` for a collider."""
        found = {
            "lateralFriction": float(self.friction[number]),
            "spinningFriction": float(self.spinning[number]),
            "rollingFriction": float(self.rolling[number]),
            "restitution": float(self.restitution[number]),
        }
        if settings["friction_anchors"]:
            found["frictionAnchor"] = 1
        if self.rebounds[number]:
            found["contactProcessingThreshold"] = REBOUND_GAP * settings["restitution_speed"] * dt
            found["contactStiffness"] = STIFFNESS
            # Of two surfaces Bullet adds the damping and halves the stiffness.
            found["contactDamping"] = 0.25 * STIFFNESS * settings["rebound_time_constant"]
        return found

    def effective(self) -> Mapping[str, EffectiveCoefficient]:
        """Return the coefficients in effect."""

        def added(terms: Floats) -> Callable[[int, NDArray[np.intp]], Floats]:
            f = self.friction
            return lambda i, j: np.minimum(terms[i] * f[j] + terms[j] * f[i], MAX_FRICTION)

        return {
            "friction": EffectiveCoefficient(
                lambda i, j: np.minimum(self.friction[i] * self.friction[j], MAX_FRICTION), LIMITED
            ),
            "torsional_friction": EffectiveCoefficient(added(self.spinning), ADDED),
            "rolling_friction": EffectiveCoefficient(added(self.rolling), ADDED),
        }


def bullet_materials(layout: Layout) -> BulletMaterials:
    """Return Bullet's coefficients of all colliders."""
    friction = np.sqrt(coefficients(layout, "friction"))
    return BulletMaterials(
        friction,
        _terms(layout, "torsional_friction", friction),
        _terms(layout, "rolling_friction", friction),
        np.sqrt(coefficients(layout, "restitution")),
        rebounding(layout),
    )


def rebounding(layout: Layout) -> NDArray[np.bool_]:
    """Return for every collider (n,) whether it rebounds from any that it may touch."""
    bouncy = coefficients(layout, "restitution") > 0.0
    return np.asarray(bouncy & layout.collides[:, bouncy].any(axis=1))


def _terms(layout: Layout, name: str, f: Floats) -> Floats:
    """Return the torsional or rolling friction (n,) of each collider, beside the sliding friction `f`."""
    if not coefficients(layout, name).any():
        return np.zeros(len(f))
    materials, numbers = material_numbers(each.material for each in layout.colliders)
    wanted = geometric_means(materials[:, COEFFICIENTS.index(name)])
    products = geometric_means(materials[:, COEFFICIENTS.index("friction")])
    sums = np.divide(wanted, products, out=np.full_like(wanted, np.nan), where=products > 0.0)
    terms = pair_terms(numbers, sums, layout.collides) * f
    for k in np.flatnonzero(f == 0.0).tolist():
        partners = np.flatnonzero(layout.collides[k] & (f > 0.0))
        if len(partners):
            terms[k] = wanted[numbers[k], numbers[partners[0]]] / f[partners[0]]
    return terms


MAX_VERTICES = 100_000
"""Largest number of points of a height field; Bullet takes 131,072 in one call."""


EXTENT = 1000.0
"""Half the edge [m] of the box that stands for a plane from which bodies rebound."""


class ShapeFiles:
    """URDF elements of shapes, with the hulls of meshes as files in one folder."""

    def __init__(self, folder: Path, flags: int = 0) -> None:
        """`flags` are those of Bullet's `loadURDF` for all objects with shapes."""
        self.flags = flags
        self._folder = folder
        self._files: dict[Mesh | Ellipsoid, Path] = {}

    def elements(self, shapes: tuple[PlacedShape, ...], T: Floats) -> list[str]:
        """Return the ``<collision>`` elements of shapes whose owner has the pose T (4, 4) in its link."""
        return [self._element(each, T @ each.T) for each in shapes if not is_ground(each)]

    def _element(self, placed: PlacedShape, T: Floats) -> str:
        return f"<collision>\n{pose_element(T)}\n<geometry>{self._geometry(placed)}</geometry></collision>"

    def _geometry(self, placed: PlacedShape) -> str:
        shape = placed.shape
        if isinstance(shape, Box):
            return f'<box size="{" ".join(map(locale_free, shape.size))}"/>'
        if isinstance(shape, Sphere):
            return f'<sphere radius="{locale_free(shape.radius)}"/>'
        if isinstance(shape, Cylinder | Capsule):
            kind = type(shape).__name__.lower()
            return f'<{kind} radius="{locale_free(shape.radius)}" length="{locale_free(shape.length)}"/>'
        assert isinstance(shape, Mesh | Ellipsoid)
        return f'<mesh filename="{self._hull_file(shape)}"/>'

    def _hull_file(self, shape: Mesh | Ellipsoid) -> str:
        if shape not in self._files:
            # Of an OBJ file Bullet makes a compound of hulls, whose margin cannot be set.
            path = self._folder / f"hull{len(self._files)}.stl"
            # Bullet has no ellipsoid.
            vertices, faces = shape.hull if isinstance(shape, Mesh) else shape.triangles()
            path.write_bytes(binary_stl(vertices[faces]))
            self._files[shape] = path
        return str(self._files[shape])

    def block(self) -> Path:
        """Return a URDF file of a fixed box whose upper face stands for the plane z = 0."""
        path = self._folder / "block.urdf"
        size, origin = locale_free(2.0 * EXTENT), locale_free(-EXTENT)
        inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        path.write_text(
            f'<robot name="block"><link name="b"><inertial><mass value="0"/>{inertia}</inertial>'
            f'<collision><origin xyz="0 0 {origin}"/><geometry><box size="{size} {size} {size}"/></geometry>'
            "</collision></link></robot>",
            encoding="ascii",
        )
        return path


def binary_stl(triangles: Floats) -> bytes:
    """Return triangles (n, 3, 3) as a binary STL file, with the normals by which they are shaded."""
    records = np.zeros(
        len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]
    )
    records["corners"] = triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = normals / np.where(lengths > 0.0, lengths, 1.0)
    return b"\0" * 80 + len(triangles).to_bytes(4, "little") + records.tobytes()


def is_ground(placed: PlacedShape) -> bool:
    """Check whether a shape is a plane or a height field: only fixed bodies have one, and URDF has none."""
    return isinstance(placed.shape, Plane | HeightField)


def load_ground(
    client: BulletClient, files: ShapeFiles, placed: PlacedShape, T: Floats, rebounds: bool
) -> int:
    """Load a plane or height field whose owner has the pose T (4, 4); return Bullet's number of the body.

    A plane that `rebounds` is the upper face of a large box, because with a plane Bullet finds one point of
    contact in a step: a body that lands flat would rebound from one corner.
    """
    engine, shape, at = client.engine, placed.shape, T @ placed.T
    position, quat = at[:3, 3].tolist(), quat_from_rotation(at[:3, :3]).tolist()
    if isinstance(shape, Plane) and rebounds:
        with decimal_point():
            path = str(files.block())
            body = client.call(engine.loadURDF, path, position, quat, useFixedBase=True, flags=files.flags)
        return int(body)
    if isinstance(shape, Plane):
        number = client.call(engine.createCollisionShape, engine.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0])
    else:
        assert isinstance(shape, HeightField)
        vertices, faces = shape.triangles()
        if len(vertices) > MAX_VERTICES:
            raise EngineLimitError(
                f"a height field has {len(vertices)} points; Bullet supports at most {MAX_VERTICES}"
            )
        number = client.call(
            engine.createCollisionShape,
            engine.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=np.asarray(faces).ravel().tolist(),
        )
    return int(
        client.call(
            engine.createMultiBody,
            baseMass=0.0,
            baseCollisionShapeIndex=number,
            basePosition=position,
            baseOrientation=quat,
        )
    )


MAX_LINKS = 121
"""Largest number of links of a robot besides its root: Bullet reports the states of no more."""

IMPLICIT_CYLINDER = 128
"""Bullet's flag URDF_USE_IMPLICIT_CYLINDER, without which a cylinder becomes a prism."""

UNLIMITED = 1e30
"""Limit of a joint that is limited in the other direction only."""

FREE = {"linearDamping": 0.0, "angularDamping": 0.0, "maxJointVelocity": 1e300}
"""Options of `changeDynamics` for the root, without which Bullet damps every link and limits speeds."""


class BulletObject:
    """A tree of links in a Bullet world, with the shapes of its colliders."""

    def __init__(
        self,
        client: BulletClient,
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

    def place_joints(self, positions: Reals, rates: Reals, joints: Sequence[int] | None = None) -> None:
        """Set the state of all joints of the tree, or of those with these numbers."""
        if positions:
            self.client.call(
                self.client.engine.resetJointStatesMultiDof,
                self.body,
                self.links if joints is None else [self.links[k] for k in joints],
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


Place = tuple[int, int]
"""Bullet's numbers of a body and of its link."""


def set_filters(
    client: BulletClient,
    layout: Layout,
    places: Sequence[Sequence[Place]],
    materials: BulletMaterials,
    settings: Mapping[str, Any],
    dt: float,
) -> None:
    """Set the materials of all colliders, and which pairs of them may touch."""
    engine = client.engine
    for number, (collider, found) in enumerate(zip(layout.colliders, places, strict=True)):
        options = materials.options(number, settings, dt)
        if any(isinstance(each.shape, Mesh | Ellipsoid) for each in collider.shapes):
            options["collisionMargin"] = settings["mesh_margin"]
        for body, link in found:
            client.call(engine.changeDynamics, body, link, **options)
    for i, first in enumerate(places):
        for j in range(i):
            for body_a, link_a in first:
                for body_b, link_b in places[j]:
                    client.call(
                        engine.setCollisionFilterPair,
                        body_a,
                        body_b,
                        link_a,
                        link_b,
                        int(layout.collides[i, j]),
                    )
