"""A world in Drake: a discrete plant with a scene graph (`build`), its state, contacts and queries.

The plant's discrete update is called directly, so that a step depends on q, v and the forces alone: they are
all of the state. Contacts and their forces are those of the last step, computed again from its beginning when
they are asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx.engines.drake.library import DRAKE_FAILURES, captured_log, drake_version, error_message
from dynx.engines.drake.world.build import build_scene
from dynx.engines.drake.world.contacts import read_contacts, touching_point
from dynx.engines.drake.world.materials import effective_materials
from dynx.engines.drake.world.options import SETTINGS
from dynx.spatial.scalar import Floats
from dynx.steppers.failures import translate_failures
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Stepper, TouchingPoint

LONGEST = 1.001
"""Squared length of a quaternion above which it is normalised."""

engine_errors = translate_failures(DRAKE_FAILURES, error_message)


class DrakeStepper(Stepper):
    """A scene in Drake behind the interface of `Stepper`."""

    name: ClassVar[str] = "drake"
    settings: ClassVar[Mapping[str, Setting]] = SETTINGS
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
        self._surfaces = self._plant.get_contact_surface_representation() if hydroelastic else None
        self._past: tuple[Floats, Floats] | None = None
        q, v = self._state()
        for robot, coordinates in zip(layout.robots, built.robots, strict=True):
            coordinates.write(robot.q, robot.v, q, v)
        for number, body in built.bodies.items():
            body.write(layout.bodies[number].T, layout.bodies[number].twist, q, v)
        self._set_state(q, v)

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        return effective_materials()

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
