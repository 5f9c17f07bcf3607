"""A world in MuJoCo: the scene compiled into one model (`build`), its state and contacts.

`mj_step` computes everything at the state before the step and then integrates. So contacts and their forces
are those of the beginning of the last step, and the poses that queries need are computed when they are asked
for.

**Mimic joints** are coupled by torques, so that they follow exactly where nothing touches the robot. MuJoCo
couples joints by soft equality constraints only. Here the torque of every joint is chosen so that the
acceleration of the tree is that of the coupled robot: with v_tree = S v and the equation of motion M a = tau
- b of the tree, the coupled robot has (S' M S) a = tau - S' b, and the tree needs the torque M S a + b. The
constraints are then idle, except where contacts and limits act on mimic joints.

With damping D of the joints, MuJoCo's integrators solve (M + h D) a = f + J' force in steps of h, but its
constraints hold for the acceleration without h D: force = -J acc / R with M acc = f + J' force, where R is
their regularisation. The tree then needs f = (M + h D) S a - J' force, with force = -h J M^-1 D S a / R.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from dynx.engines.mujoco.build import build_scene
from dynx.engines.mujoco.coordinates import BodyCoordinates, RobotCoordinates
from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.materials import LEAST_STEPS, SETTINGS, time_constant
from dynx.errors import EngineError, nonblank_lines, shown
from dynx.spatial.scalar import Floats
from dynx.steppers.failures import translate_failures
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Layout, RobotLayout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, SlidingFace, Stepper, TouchingPoint


class CoupledRobot:
    """A robot with mimic joints: its torque in coordinates of the model, and the torque of its tree."""

    def __init__(self, robot: RobotLayout, first: int, row: int, dt: float) -> None:
        """`first` is the index in MuJoCo's v at which the robot begins, `row` that of its first mimic joint
        in the constraints."""
        coupling = robot.model.mechanism.coupling
        if coupling is None:
            raise AssertionError("a robot without mimic joints")
        self._S = S = coupling.matrix()
        self._slice = slice(first, first + len(S))
        base = len(S) - len(robot.damping)
        self._damping = np.concatenate([np.zeros(base), robot.damping])
        self._damping_of_step = dt * self._damping
        self._damped = S.T @ (self._damping_of_step[:, None] * S)
        mimics = [k for k, joint in enumerate(j for j in robot.model.joints if j.moves) if joint.mimic]
        self._rows = slice(row, row + len(mimics))
        own = [k for k in range(len(coupling.index)) if k not in mimics]
        self._J = np.eye(len(S))[[base + k for k in mimics]]
        for each, k in zip(self._J, mimics, strict=True):
            each[base + own[coupling.index[k]]] -= coupling.scale[k]
        self.tau: Floats = np.zeros(S.shape[1])
        """Torque in coordinates of the model, with the wrench on a floating base as in MuJoCo."""

    def apply(self, model: Any, data: Any) -> None:
        """Write the torque of the tree, between `mj_step1` and `mj_step2`."""
        part, S = self._slice, self._S
        M = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, M)
        M = M[part, part]
        bias = data.qfrc_bias[part] + self._damping * data.qvel[part] - data.qfrc_spring[part]
        acceleration = S @ np.linalg.solve(S.T @ M @ S + self._damped, self.tau - S.T @ bias)
        force = M @ acceleration
        if self._damping.any():
            damped = self._damping_of_step * acceleration
            violation = self._J @ np.linalg.solve(M, damped)
            force += damped + self._J.T @ (violation / data.efc_R[self._rows])
        data.qfrc_applied[part] = force + bias


def read_contacts(
    model: Any, data: Any, geom_collider: tuple[int, ...], *, forces: bool
) -> list[TouchingPoint]:
    """Return the contacts that `data` holds, with the forces of the last step if `forces`."""
    found = []
    force = np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        first, second = contact.geom
        # MuJoCo's normal goes from the first geom to the second, and the force acts on the second.
        frame = contact.frame.reshape(3, 3)
        normal, distance = -frame[0], float(contact.dist)
        half = 0.5 * distance * frame[0]
        along, friction = 0.0, np.zeros(3)
        if forces and contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, number, force)
            along, friction = float(force[0]), -(force[1] * frame[1] + force[2] * frame[2])
        found.append(
            TouchingPoint(
                geom_collider[first],
                geom_collider[second],
                contact.pos - half,
                contact.pos + half,
                normal,
                distance,
                along,
                friction,
            )
        )
    return found


_PARTS = mujoco.mjtState
STATE = int(_PARTS.mjSTATE_TIME | _PARTS.mjSTATE_QPOS | _PARTS.mjSTATE_QVEL | _PARTS.mjSTATE_WARMSTART)
"""Part of MuJoCo's state that determines the later steps; forces of earlier ones do not act in them."""

CONTACTS_LOST = int(mujoco.mjtWarning.mjWARN_CONTACTFULL)
CONSTRAINTS_LOST = int(mujoco.mjtWarning.mjWARN_CNSTRFULL)
"""Numbers of MuJoCo's warnings that memory is too small, so that contacts or constraints were left out."""

engine_errors = translate_failures((Exception,), lambda error: (nonblank_lines(error) or ["no message"])[0])


MAX_HOP = 0.05
"""Height to which a body that slides may hop, relative to its own: above it friction is wrong by percents."""


class MujocoStepper(Stepper):
    """A scene in MuJoCo behind the interface of `Stepper`."""

    name: ClassVar[str] = "mujoco"
    settings: ClassVar[Mapping[str, Any]] = SETTINGS
    takes_ball_joints: ClassVar[bool] = True
    contact_law: ClassVar[str] = "damped springs between accelerations at contacts and joint limits"
    inexact: ClassVar[Mapping[Feature, str]] = {
        Feature.DRY_FRICTION: "a soft constraint, so that joints that stick creep, at any step",
    }
    native_queries: ClassVar[str] = "dynx.engines.mujoco.native_queries:MujocoQueries"

    @engine_errors
    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self.closed = False
        self._slip_time_constant = time_constant(settings, "slip_time_constant", dt)
        built = build_scene(layout, dt, settings)
        self.built, self.model = built, built.model
        self.data = data = built.data
        self._warnings = data.warning.number
        self._robots = [
            RobotCoordinates(data, robot.model, first)
            for robot, first in zip(layout.robots, built.robots, strict=True)
        ]
        self._coupled: dict[int, CoupledRobot] = {}
        row = 0
        for number, robot in enumerate(layout.robots):
            if robot.model.mechanism.coupling is not None:
                # Mimic joints are the first constraints of the document, in the order of its robots.
                self._coupled[number] = CoupledRobot(robot, built.robots[number][1], row, dt)
                row += sum(joint.mimic is not None for joint in robot.model.joints)
        self._applied = [
            self._coupled[number].tau if number in self._coupled else robot.applied
            for number, robot in enumerate(self._robots)
        ]
        self._loaded = self._pushed = False
        """True if torques, and wrenches on bodies, of an earlier step may still be in MuJoCo's data."""
        self._bodies = {
            number: BodyCoordinates(built.model, data, built.bodies[number], body)
            for number, body in enumerate(layout.bodies)
            if not body.fixed
        }
        self._body_numbers = np.array(built.bodies, dtype=np.intp)
        self._moved()

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        return frozenset(Feature)

    @classmethod
    def settings_in_effect(cls, settings: Mapping[str, Any], dt: float) -> Mapping[str, Any]:
        return {name: time_constant(settings, name, dt) for name in LEAST_STEPS}

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        return self.built.materials.effective()

    def sliding_fault(self, slide: SlidingFace) -> str | None:
        # Friction that opposes slip within this time pushes the body off the surface, as its contacts are
        # convex problems: measured on boxes at 1 to 30 m/s and steps of 1 to 4 ms.
        speed = slide.friction * slide.slip * self.dt / self._slip_time_constant
        hop = speed**2 / (2.0 * slide.gravity)
        if hop <= MAX_HOP * slide.size[2]:
            return None
        return f"hops by {1e3 * hop:.2g} mm, and may tumble"

    # -- motion -------------------------------------------------------------------------------

    @engine_errors
    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        model, data, warnings = self.model, self.data, self._warnings
        torques, wrenches = forces.torques, forces.wrenches
        if torques or self._loaded:
            self._apply(torques)
        if wrenches is not None:
            data.xfrc_applied[self._body_numbers] = wrenches
            self._pushed = True
        elif self._pushed:
            data.xfrc_applied[self._body_numbers] = 0.0
            self._pushed = False
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

    def _apply(self, torques: Sequence[tuple[int, Floats]]) -> None:
        applied = self._applied
        if len(torques) < len(applied):
            for given in applied:
                given[:] = 0.0
        for k, tau in torques:
            applied[k][:] = self._robots[k].forces(tau)
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

    @engine_errors
    def dump(self) -> bytes:
        state = np.zeros(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self.data, state, STATE)
        return state.tobytes()

    @engine_errors
    def load(self, data: bytes) -> None:
        # Files of earlier versions go on with the forces of the last step.
        state = np.frombuffer(data)[: mujoco.mj_stateSize(self.model, STATE)]
        mujoco.mj_setState(self.model, self.data, state, STATE)
        self._loaded = self._pushed = True
        self._moved()

    # -- queries ------------------------------------------------------------------------------

    @engine_errors
    def contacts(self) -> Sequence[TouchingPoint]:
        self._find_contacts()
        return read_contacts(self.model, self.data, self.built.geom_collider, forces=self._stepped)

    @engine_errors
    def touching_pairs(self) -> Iterable[tuple[int, int]]:
        self._find_contacts()
        collider = self.built.geom_collider
        return [(collider[a], collider[b]) for a, b in self.data.contact.geom.tolist()]

    def _find_contacts(self) -> None:
        """Find the contacts of a state that was set."""
        if not self._stepped:
            mujoco.mj_fwdPosition(self.model, self.data)
            self._placed = True

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
                self.data,
                self.model,
                self.built,
            )

    def _moved(self) -> None:
        """Note that the state was set, so that contacts and poses in MuJoCo's data are not current."""
        self._stepped = self._placed = False

    def place(self) -> None:
        """Compute the poses of all geoms at the present state."""
        if not self._placed:
            mujoco.mj_kinematics(self.model, self.data)
            self._placed = True
