"""A world in MuJoCo: the scene compiled into one model (`build`), its state, contacts and queries.

`mj_step` computes everything at the state before the step and then integrates. So contacts and their forces
are those of the beginning of the last step, and the poses that queries need are computed when they are asked
for.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.world.build import build_scene
from dynx.engines.mujoco.world.coordinates import BodyCoordinates, RobotCoordinates
from dynx.engines.mujoco.world.mimics import CoupledRobot
from dynx.engines.mujoco.world.options import LEAST_STEPS, SETTINGS, time_constant
from dynx.engines.mujoco.world.shapes import FIELD_GROUP
from dynx.engines.mujoco.world.touching import closest_of, read_contacts
from dynx.errors import EngineError, nonblank_lines, shown
from dynx.model.geometry import HeightField
from dynx.model.geometry.ray_casting import cast_on_shape
from dynx.spatial.scalar import Floats
from dynx.steppers.failures import translate_failures
from dynx.steppers.layout import Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import RayHit, Stepper, Torque, TouchingPoint

_MISS = RayHit(None, np.inf, np.full(3, np.nan))

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION)
"""Part of MuJoCo's state that determines the later steps; the physics state alone lacks the warm start."""

CONTACTS_LOST = int(mujoco.mjtWarning.mjWARN_CONTACTFULL)
CONSTRAINTS_LOST = int(mujoco.mjtWarning.mjWARN_CNSTRFULL)
"""Numbers of MuJoCo's warnings that memory is too small, so that contacts or constraints were left out."""

_engine_errors = translate_failures((Exception,), lambda error: (nonblank_lines(error) or ["no message"])[0])


class MujocoWorld(Stepper):
    """A scene in MuJoCo behind the interface of `Stepper`."""

    name: ClassVar[str] = "mujoco"
    settings: ClassVar[Mapping[str, Any]] = SETTINGS

    @_engine_errors
    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self.closed = False
        built = build_scene(layout, dt, settings)
        self._built, self._model = built, built.model
        self._data = data = built.data
        self._warnings = data.warning.number
        self._robots = [
            RobotCoordinates(data, robot.model, first)
            for robot, first in zip(layout.robots, built.robots, strict=True)
        ]
        self._coupled = {
            number: CoupledRobot(robot, built.robots[number][1], dt)
            for number, robot in enumerate(layout.robots)
            if robot.model.mechanism.coupling is not None
        }
        self._applied = [
            self._coupled[number].tau if number in self._coupled else robot.applied
            for number, robot in enumerate(self._robots)
        ]
        self._loaded = False
        """True if forces of an earlier step may still be in MuJoCo's data."""
        self._bodies = {
            number: BodyCoordinates(built.model, data, built.bodies[number], body)
            for number, body in enumerate(layout.bodies)
            if not body.fixed
        }
        self._body_numbers = np.array(built.bodies, dtype=np.intp)
        for number, robot in enumerate(layout.robots):
            self._robots[number].write(robot.q, robot.v)
        for number, moving in self._bodies.items():
            moving.write(layout.bodies[number].T, layout.bodies[number].twist)
        self._moved()
        self._fields = [
            (number, placed.shape, layout.bodies[collider.owner.body].T @ placed.T)
            for number, collider in enumerate(layout.colliders)
            for placed in collider.shapes
            if isinstance(placed.shape, HeightField)
        ]
        # Height fields are left to dynx, because a ray through a point of the grid passes MuJoCo's.
        self._groups = np.ones(6, dtype=np.uint8)
        self._groups[FIELD_GROUP] = 0

    @classmethod
    def settings_in_effect(cls, settings: Mapping[str, Any], dt: float) -> Mapping[str, Any]:
        return {name: time_constant(settings, name, dt) for name in LEAST_STEPS}

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        return self._built.materials.effective()

    # -- motion -------------------------------------------------------------------------------

    def set_wrenches(self, wrenches: Floats) -> None:
        self._data.xfrc_applied[self._body_numbers] = wrenches

    @_engine_errors
    def step(self, n: int, torques: Sequence[Torque] = ()) -> None:
        model, data, warnings = self._model, self._data, self._warnings
        if torques or self._loaded:
            self._apply(torques)
        if not self._coupled:
            mujoco.mj_step(model, data, n)
        else:
            for _ in range(n):
                mujoco.mj_step1(model, data)
                for coupled in self._coupled.values():
                    coupled.apply(model, data)
                mujoco.mj_step2(model, data)
        self._stepped, self._placed = True, False
        if warnings[CONTACTS_LOST] != 1 or warnings[CONSTRAINTS_LOST] != 1:
            warnings[:] = 1
            raise EngineError(
                f"mujoco has no memory for the contacts of the scene {shown(self.layout.name)}: "
                f"{data.ncon} contacts, {data.nefc} constraints"
            )

    def _apply(self, torques: Sequence[Torque]) -> None:
        applied = self._applied
        if len(torques) < len(applied):
            for forces in applied:
                forces[:] = 0.0
        for k, tau, entries in torques:
            applied[k][:] = self._robots[k].forces(tau, entries)
        self._loaded = bool(torques)

    # -- state --------------------------------------------------------------------------------

    def robot_state(self, robot: int) -> RobotState:
        return self._robots[robot].read()

    def joint_state(self, robot: int) -> RobotState:
        return self._robots[robot].read_joints()

    def body_state(self, body: int) -> BodyState:
        if body in self._bodies:
            return self._bodies[body].read()
        return BodyState(self.layout.bodies[body].T.copy(), np.zeros(6))

    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        self._robots[robot].write(q, v)
        self._moved()

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        self._bodies[body].write(T, twist)
        self._moved()

    @_engine_errors
    def dump(self) -> bytes:
        state = np.zeros(mujoco.mj_stateSize(self._model, STATE))
        mujoco.mj_getState(self._model, self._data, state, STATE)
        return state.tobytes()

    @_engine_errors
    def load(self, data: bytes) -> None:
        mujoco.mj_setState(self._model, self._data, np.frombuffer(data), STATE)
        self._loaded = True
        self._moved()

    # -- queries ------------------------------------------------------------------------------

    @_engine_errors
    def contacts(self) -> Sequence[TouchingPoint]:
        self._find_contacts()
        return read_contacts(self._model, self._data, self._built.geom_collider, forces=self._stepped)

    @_engine_errors
    def touching_pairs(self) -> Iterable[tuple[int, int]]:
        self._find_contacts()
        collider = self._built.geom_collider
        return [(collider[a], collider[b]) for a, b in self._data.contact.geom.tolist()]

    def _find_contacts(self) -> None:
        """Find the contacts of a state that was set."""
        if not self._stepped:
            mujoco.mj_fwdPosition(self._model, self._data)
            self._placed = True

    @_engine_errors
    def closest(self, a: int, b: int, within: float) -> TouchingPoint | None:
        self._place()
        geoms = self._built.collider_geoms
        found = closest_of(self._model, self._data, geoms[a], geoms[b], within)
        return None if found is None else TouchingPoint(a, b, *found)

    @_engine_errors
    def cast_rays(self, origins: Floats, directions: Floats, length: float) -> Sequence[RayHit]:
        self._place()
        nearest = self._cast_on_fields(origins, directions)
        geom, normal = np.zeros(1, dtype=np.int32), np.zeros(3)
        hits = []
        for ray in range(len(origins)):
            distance = mujoco.mj_ray(
                self._model,
                self._data,
                origins[ray],
                directions[ray],
                self._groups,
                True,
                -1,
                geom,
                normal,
            )
            collider: int | None = None
            if 0.0 <= distance <= length:
                collider, at, outward = self._built.geom_collider[geom[0]], float(distance), normal.copy()
            if nearest is not None and nearest[1][ray] <= (length if collider is None else at):
                collider, at, outward = nearest[0][ray], float(nearest[1][ray]), nearest[2][ray]
            hits.append(_MISS if collider is None else RayHit(collider, at, outward))
        return hits

    def _cast_on_fields(self, origins: Floats, directions: Floats) -> tuple[Any, Floats, Floats] | None:
        """Return the collider, distance and normal of each ray on height fields; None if there are none."""
        best = None
        for number, shape, T in self._fields:
            distance, normal = cast_on_shape(shape, T, origins, directions)
            if best is None:
                best = np.full(len(origins), number), distance, normal
                continue
            nearer = distance < best[1]
            best[0][nearer], best[1][nearer], best[2][nearer] = number, distance[nearer], normal[nearer]
        return best

    # -- end ----------------------------------------------------------------------------------

    @property
    def version(self) -> str:
        return f"mujoco {mujoco.__version__}"

    def close(self) -> None:
        """Release MuJoCo's model and data."""
        if not self.closed:
            self.closed = True
            del (
                self._robots,
                self._bodies,
                self._coupled,
                self._applied,
                self._warnings,
                self._data,
                self._model,
                self._built,
            )

    def _moved(self) -> None:
        """Note that the state was set, so that contacts and poses in MuJoCo's data are not current."""
        self._stepped = self._placed = False

    def _place(self) -> None:
        """Compute the poses of all geoms at the present state."""
        if not self._placed:
            mujoco.mj_kinematics(self._model, self._data)
            self._placed = True
