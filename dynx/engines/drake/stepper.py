"""A world in Drake: a discrete plant with a scene graph (`build`), its state and contacts.

The plant's discrete update is called directly, so that a step depends on q, v and the forces alone: they are
all of the state. Contacts and their forces are those of the last step, computed again from its beginning when
they are asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx.engines.drake.build import build_scene
from dynx.engines.drake.library import DRAKE_FAILURES, captured_log, drake_version, error_message
from dynx.engines.drake.materials import SETTINGS, effective_materials
from dynx.spatial.scalar import Floats
from dynx.steppers.failures import translate_failures
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, SlidingFace, Stepper, TouchingPoint


def read_contacts(results: Any, query: Any, collider_of: Mapping[int, int]) -> list[TouchingPoint]:
    """Return the contacts of a step: one for each point, and one at the centre of pressure of each surface.

    A surface has the depth of the pair of shapes as its distance. `query` is that at the beginning of the
    step.
    """
    infos = [results.point_pair_contact_info(k) for k in range(results.num_point_pair_contacts())]
    # Drake's force is that on the second body.
    found = [
        touching_point(info.point_pair(), -np.array(info.contact_force()), collider_of) for info in infos
    ]
    count = results.num_hydroelastic_contacts()
    if count:
        pairs = query.ComputePointPairPenetration()
        depths = {(pair.id_A.get_value(), pair.id_B.get_value()): float(pair.depth) for pair in pairs}
        found += [
            _on_surface(results.hydroelastic_contact_info(k), depths, collider_of) for k in range(count)
        ]
    return found


def touching_point(pair: Any, force: Floats, collider_of: Mapping[int, int]) -> TouchingPoint:
    """Return the contact of a pair of penetrating points, with the force on the first body."""
    normal = np.array(pair.nhat_BA_W)
    return TouchingPoint(
        collider_of[pair.id_A.get_value()],
        collider_of[pair.id_B.get_value()],
        np.array(pair.p_WCa),
        np.array(pair.p_WCb),
        normal,
        -float(pair.depth),
        *parts_of_force(force, normal),
    )


def _on_surface(
    info: Any, depths: Mapping[tuple[int, int], float], collider_of: Mapping[int, int]
) -> TouchingPoint:
    surface = info.contact_surface()
    a, b = surface.id_M().get_value(), surface.id_N().get_value()
    faces = range(surface.num_faces())
    # The normals of the surface go from the second shape into the first.
    normal = np.sum([surface.area(k) * surface.face_normal(k) for k in faces], axis=0)
    normal = normal / np.linalg.norm(normal)
    depth = depths.get((a, b), depths.get((b, a), 0.0))
    wrench = info.F_Ac_W()
    force = np.array(wrench.translational())
    center = _center_of_pressure(surface, normal, force, np.array(wrench.rotational()))
    half = 0.5 * depth * normal
    return TouchingPoint(
        collider_of[a],
        collider_of[b],
        center - half,
        center + half,
        normal,
        -depth,
        *parts_of_force(force, normal),
    )


def _center_of_pressure(surface: Any, normal: Floats, force: Floats, moment: Floats) -> Floats:
    """Return the point of the surface about which the contact force has no moment but one along the normal.

    `moment` is the moment about the centroid, which is returned where the point would be outside of the
    surface.
    """
    centroid = np.array(surface.centroid())
    along = float(force @ normal)
    if along <= 0.0:
        return centroid
    shift = np.cross(normal, moment) / along
    mesh = surface.tri_mesh_W() if surface.is_triangle() else surface.poly_mesh_W()
    corners = np.array([mesh.vertex(k) for k in range(mesh.num_vertices())])
    reach = float(np.max(np.linalg.norm(corners - centroid, axis=1)))
    return centroid + shift if float(np.linalg.norm(shift)) <= reach else centroid


def parts_of_force(force: Floats, normal: Floats) -> tuple[float, Floats]:
    """Return the force along the normal, at least 0, and the rest.

    Friction on the parts of a bent surface is not orthogonal to the mean normal, and may pull along it.
    """
    along = max(0.0, float(force @ normal))
    return along, force - along * normal


LONGEST = 1.001
"""Squared length of a quaternion above which it is normalised."""

engine_errors = translate_failures(DRAKE_FAILURES, error_message)


MIN_LOAD, MAX_FEEDBACK, MIN_SLIDING_STEPS = 0.5, 1.7, 60
"""A sliding body chatters where its load is nearer to the front end (1) than to the centre (0), the angle of
the natural frequency of its contact in a step [rad], times the ratio of both distances, is above the second,
and the slide lasts for that number of steps."""


class DrakeStepper(Stepper):
    """A scene in Drake behind the interface of `Stepper`."""

    name: ClassVar[str] = "drake"
    settings: ClassVar[Mapping[str, Setting]] = SETTINGS
    contact_law: ClassVar[str] = (
        "compliant contacts and joint limits, and friction that grows with the speed up to a tolerance"
    )
    native_queries: ClassVar[str] = "dynx.engines.drake.native_queries:DrakeQueries"

    @engine_errors
    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self.closed = self._diverged = False
        with captured_log():
            self.built = built = build_scene(layout, dt, settings)
            self._root = built.diagram.CreateDefaultContext()
        self._plant, self._diagram = built.plant, built.diagram
        self._past_root: Any = None
        self._context = self._plant.GetMyMutableContextFromRoot(self._root)
        self._updates = self._diagram.AllocateDiscreteVariables()
        self._port = self._plant.get_applied_generalized_force_input_port()
        self._applied: Floats = np.zeros(self._plant.num_velocities())
        self._port.FixValue(self._context, self._applied)
        self._quaternions = built.quaternions
        hydroelastic = settings["contact_model"] == "hydroelastic"
        self._modulus: float = settings["modulus"]
        self._surfaces = self._plant.get_contact_surface_representation() if hydroelastic else None
        self._past: tuple[Floats, Floats] | None = None
        q, v = self._state()
        for robot, coordinates in zip(layout.robots, built.robots, strict=True):
            coordinates.write(robot.q, robot.v, q, v)
        for number, body in built.bodies.items():
            body.write(layout.bodies[number].T, layout.bodies[number].twist, q, v)
        self._set_state(q, v)

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        # A spring of Drake has no negative stiffness.
        pushes = any((robot.stiffness < 0.0).any() for robot in layout.robots)
        return frozenset(Feature) - {Feature.DRY_FRICTION} - ({Feature.SPRINGS} if pushes else set())

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        return effective_materials()

    def sliding_fault(self, slide: SlidingFace) -> str | None:
        if not slide.flat or self._surfaces is None or not MIN_LOAD < slide.load < 1.0:
            return None
        # Friction of a step follows from the load of the step before, and shifts the load in turn, the more
        # the nearer it is to the front end: measured on boxes and cylinders of 0.06 to 0.5 m.
        if slide.slip < MIN_SLIDING_STEPS * self.dt * slide.friction * slide.gravity:
            return None
        stiffness = 2.0 * self._modulus * slide.size[0] * slide.size[1] / min(slide.size)
        turns = self.dt * math.sqrt(stiffness / slide.mass)
        if turns * slide.load / (1.0 - slide.load) <= MAX_FEEDBACK:
            return None
        return "chatters on its front edge, and may tumble"

    # -- motion -------------------------------------------------------------------------------

    @engine_errors
    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        applied = np.zeros(len(self._applied))
        if forces.wrenches is not None:
            for number, body in self.built.bodies.items():
                force, moment = forces.wrenches[number, :3], forces.wrenches[number, 3:]
                applied[body.forces] = np.concatenate([moment, force])
        for k, tau in forces.torques:
            self.built.robots[k].write_forces(tau, self._plant.GetPositions(self._context), applied)
        if not np.array_equal(applied, self._applied):
            self._port.FixValue(self._context, applied)
            self._applied = applied
        diagram, root, updates = self._diagram, self._root, self._updates
        for taken in range(n):
            if self._diverged:
                return
            if taken == n - 1:
                self._past = np.array(self._plant.GetPositionsAndVelocities(self._context)), self._applied
            try:
                diagram.CalcForcedDiscreteVariableUpdate(root, updates)
            except DRAKE_FAILURES as error:
                if "NaN" not in str(error):
                    raise
                self._diverged = True
                return
            root.SetDiscreteState(updates)
            if len(self._quaternions):
                self._normalise()

    def _normalise(self) -> None:
        """Normalise the quaternions of the state where one has become too long."""
        q = self._plant.GetPositions(self._context)
        quaternions = q[self._quaternions]
        lengths = np.einsum("ij,ij->i", quaternions, quaternions)
        if (lengths > LONGEST).any():
            q = np.array(q)
            q[self._quaternions] = quaternions / np.sqrt(lengths)[:, None]
            self._plant.SetPositions(self._context, q)

    # -- state --------------------------------------------------------------------------------

    @engine_errors
    def robot_state(self, robot: int) -> RobotState:
        return self.built.robots[robot].read(*self._state())

    @engine_errors
    def body_state(self, body: int) -> BodyState:
        if body in self.built.bodies:
            return self.built.bodies[body].read(*self._state())
        return BodyState(self.layout.bodies[body].T.copy(), np.zeros(6))

    @engine_errors
    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        state = self._state()
        self.built.robots[robot].write(q, v, *state)
        self._set_state(*state)

    @engine_errors
    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        state = self._state()
        self.built.bodies[body].write(T, twist, *state)
        self._set_state(*state)

    @engine_errors
    def dump(self) -> bytes:
        return np.concatenate(self._state()).tobytes()

    @engine_errors
    def load(self, data: bytes) -> None:
        state = np.frombuffer(data).copy()
        self._set_state(*np.split(state, [self._plant.num_positions()]))

    def _state(self) -> tuple[Floats, Floats]:
        """Return copies of the plant's q and v; NaN where the step to them failed because of a NaN."""
        if self._diverged:
            return np.full(self._plant.num_positions(), np.nan), np.full(self._plant.num_velocities(), np.nan)
        plant, context = self._plant, self._context
        return np.array(plant.GetPositions(context)), np.array(plant.GetVelocities(context))

    def _set_state(self, q: Floats, v: Floats) -> None:
        self._plant.SetPositionsAndVelocities(self._context, np.concatenate([q, v]))
        self._past, self._diverged = None, False

    # -- queries ------------------------------------------------------------------------------

    @engine_errors
    def contacts(self) -> Sequence[TouchingPoint]:
        if self._past is None:
            pairs = self.query().ComputePointPairPenetration()
            return [touching_point(pair, np.zeros(3), self.built.collider_of) for pair in pairs]
        state, forces = self._past
        query = self._query_at(state)
        self._port.FixValue(self._plant.GetMyMutableContextFromRoot(self._past_root), forces)
        results = self._plant.get_contact_results_output_port().Eval(
            self._plant.GetMyContextFromRoot(self._past_root)
        )
        return read_contacts(results, query, self.built.collider_of)

    @engine_errors
    def touching_pairs(self) -> Iterable[tuple[int, int]]:
        if self._past is None:
            return super().touching_pairs()
        # Contacts are found without their forces, which the solver would compute a second time.
        query = self._query_at(self._past[0])
        surfaces: Sequence[Any] = ()
        if self._surfaces is None:
            points = query.ComputePointPairPenetration()
        else:
            surfaces, points = query.ComputeContactSurfacesWithFallback(self._surfaces)
        pairs = [(pair.id_A, pair.id_B) for pair in points]
        pairs += [(surface.id_M(), surface.id_N()) for surface in surfaces]
        collider_of = self.built.collider_of
        return [(collider_of[a.get_value()], collider_of[b.get_value()]) for a, b in pairs]

    def _query_at(self, state: Floats) -> Any:
        """Return the query object of the geometry at q and v, in a context of its own."""
        if self._past_root is None:
            with captured_log():
                self._past_root = self._diagram.CreateDefaultContext()
        context = self._plant.GetMyMutableContextFromRoot(self._past_root)
        self._plant.SetPositionsAndVelocities(context, state)
        graph = self.built.scene_graph
        return graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._past_root))

    def query(self) -> Any:
        """Return Drake's query of the shapes at the present state."""
        graph = self.built.scene_graph
        return graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(self._root))

    # -- end ----------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        return f"drake {drake_version()}"

    def close(self) -> None:
        """Release Drake's diagram and contexts."""
        if not self.closed:
            self.closed = True
            del self._port, self._updates, self._context, self._root, self._past_root
            del self._plant, self._diagram, self.built
