"""The interface of every backend, written out: one method for each quantity of the table.

Arguments are checked, and one sample goes straight to the engine's hook, in `QuantityCalls`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.evaluation import common_batch
from dynx.backends.hooks import apply_matrix, solution_or_nan
from dynx.backends.quantity_calls import ALL_FRAMES, ONE_FRAME, Forces, QuantityCalls
from dynx.errors import ArgumentError
from dynx.model.numbers import checked_bool
from dynx.rbd.jacobians import LOCAL, LOCAL_WORLD_ALIGNED, shift_jacobian
from dynx.registry import door, explains_names
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from dynx.distance.avoidance import AvoidanceSource
    from dynx.ik.closed_forms.solutions import IKSolutions
    from dynx.ik.options import FrameTarget, IKOptions
    from dynx.ik.result import IKResult
    from dynx.ik.tracking.path import TrackResult
    from dynx.ik.tracking.tracker import TimedMotion
    from dynx.ik.velocity import VelocityResult, VelocityTask


@explains_names
class Backend(QuantityCalls):
    """A robot in one engine, with the same methods, conventions and results for every engine.

    Arrays are float64 and take leading batch axes, which broadcast: q (..., nq), v, a, tau (..., nv). One
    sample in, one sample out. SI units. Poses are T_world_frame (..., 4, 4). Jacobians (..., 6, nv) have
    linear rows first; `reference` names the axes and the point:

    - ``"local_world_aligned"`` (default): the frame's origin, the world's axes
    - ``"local"``: the frame's origin and axes
    - ``"world"``: the world's origin and axes (the spatial Jacobian)

    `point` (3,) [m], in the frame's axes, replaces the frame's origin in the first two cases.

    By default only the rigid bodies count. `joint_dynamics=True` adds the armature, viscous damping, Coulomb
    friction and springs of the joints, alike on every backend. The torque of these terms is
    ``armature * a + damping * v + friction * sign(v) + stiffness * (q - spring_reference)``. The armature is
    on the diagonal of the mass matrix, and the potential energy includes the energy of the springs.

    `external_forces` maps frame names to wrenches (..., 6) that act on the robot: force [N], then moment
    [N m]. `force_reference` names their point and axes, as `reference` does for a Jacobian.

    Torques are generalised forces: [N m] for a revolute joint, [N] for a prismatic joint. For a floating base
    they are the force and the moment at the origin of the base frame, in its axes. `dynx.backends.quantities`
    is the table of all quantities.

    For a batch, dynx calls the engine once for each sample, in a Python loop. A class that is `vectorized`
    computes a batch at once, such as ``reference`` (by NumPy) and ``compiled`` (by machine code). These two
    give the same numbers, up to rounding. For UR5 ``compiled`` is at least about 60 times as fast as
    ``reference`` (``dynx bench ur5 --batch 65536 --threads 1``).

    Raises only errors of `dynx.errors`. With ``validate=False`` dynx does not check arguments. They must then
    be float64 arrays of the right shape; other arguments give undefined results.
    """

    # -- kinematics ---------------------------------------------------------------------------

    def forward_kinematics(self, q: ArrayLike, frame: str | Sequence[str] | None = None) -> Floats:
        """Return T_world_frame (..., 4, 4) [1, m]; for a list of frames, or None for all, (..., n, 4, 4).

        Featherstone 2008, section 4.4. Elsewhere: Pinocchio `framesForwardKinematics`, Drake
        `CalcPoseInWorld`, MuJoCo `mj_kinematics`, PyBullet `getLinkState`.
        """
        if isinstance(frame, str):
            return self._evaluate((ONE_FRAME, frame), (q,))
        placements = self._evaluate(ALL_FRAMES, (q,))
        if frame is None:
            return placements
        names = self._arguments.frames(frame)
        return np.asarray(placements[..., [self._index(name) for name in names], :, :])

    def jacobian(
        self,
        q: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """Return the geometric Jacobian J (..., 6, nv) [m/rad, 1]: J v is the frame's velocity, linear first.

        Siciliano et al., eq. 3.30. Elsewhere: Pinocchio `computeFrameJacobian`, Drake
        `CalcJacobianSpatialVelocity`, MuJoCo `mj_jac`, PyBullet `calculateJacobian`.
        """
        J = self._evaluate(("jacobian", frame, reference), (q,))
        return J if point is None else self._at_point(J, None, q, None, frame, reference, point)

    def jacobian_derivative(
        self,
        q: ArrayLike,
        v: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """Return dJ/dt (..., 6, nv) [m/(rad s), 1/s] along the motion `v`.

        Siciliano et al., eq. 3.30, differentiated in time. Elsewhere: Pinocchio
        `getFrameJacobianTimeVariation`, MuJoCo `mj_jacDot`.
        """
        dJ = self._evaluate(("jacobian_derivative", frame, reference), (q, v))
        if point is None:
            return dJ
        J = self.jacobian(q, frame, reference=reference)
        return self._at_point(J, dJ, q, self._checked_v(v), frame, reference, point)

    def frame_velocity(
        self,
        q: ArrayLike,
        v: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """Return J v (..., 6) [m/s, rad/s]: linear, then angular velocity of the frame.

        Featherstone 2008, section 2.8. Elsewhere: Pinocchio `getFrameVelocity`, Drake
        `CalcSpatialVelocityInWorld`, MuJoCo `mj_objectVelocity`.
        """
        if point is None:
            return self._evaluate(("frame_velocity", frame, reference), (q, v))
        q, v = self._checked_q(q), self._checked_v(v)
        common_batch(q, v)
        return apply_matrix(self.jacobian(q, frame, reference=reference, point=point), v)

    def frame_acceleration(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """Return J a + dJ/dt v (..., 6) [m/s^2, rad/s^2], the time derivative of `frame_velocity`.

        In ``local_world_aligned`` that is the classical acceleration of the frame's origin; in ``local`` and
        ``world`` the spatial acceleration (Featherstone 2008, section 2.11). Gravity is not included.
        Elsewhere: Pinocchio `getFrameClassicalAcceleration`, Drake `CalcSpatialAccelerationInWorld`, MuJoCo
        `mj_objectAcceleration` (which adds gravity).
        """
        if point is None:
            return self._evaluate(("frame_acceleration", frame, reference), (q, v, a))
        q, v, a = self._checked_q(q), self._checked_v(v), self._checked_v(a, "a")
        common_batch(q, v, a)
        J = self.jacobian(q, frame, reference=reference, point=point)
        dJ = self.jacobian_derivative(q, v, frame, reference=reference, point=point)
        return apply_matrix(J, a) + apply_matrix(dJ, v)

    # -- inverse kinematics, whose bodies lie above (`dynx.ik`) ---------------------------------

    @overload
    def inverse_kinematics(
        self,
        target: ArrayLike,
        frame: str,
        q0: ArrayLike | None = None,
        *,
        all_solutions: Literal[True],
        given: Mapping[str, float] | None = None,
        position_tolerance: ArrayLike = ...,
        rotation_tolerance: ArrayLike = ...,
    ) -> IKSolutions: ...

    @overload
    def inverse_kinematics(
        self,
        target: ArrayLike | Mapping[str, ArrayLike] | Sequence[FrameTarget],
        frame: str | None = None,
        q0: ArrayLike | None = None,
        **options: Unpack[IKOptions],
    ) -> IKResult: ...

    @door("dynx.ik.solver:inverse_kinematics")
    def inverse_kinematics(
        self,
        target: ArrayLike | Mapping[str, ArrayLike] | Sequence[FrameTarget],
        frame: str | None = None,
        q0: ArrayLike | None = None,
        **options: Unpack[IKOptions],
    ) -> IKResult:
        """Return the configuration that brings `frame` to `target`: a pose (..., 4, 4) or position (..., 3).

        Several frames have targets ``{name: target}`` or a list of `dynx.ik.FrameTarget`.
        `dynx.ik.inverse_kinematics` describes the targets, and `dynx.ik.Options` the options.
        """
        raise NotImplementedError

    @door("dynx.ik.tracking.tracker:track")
    def track(
        self,
        targets: ArrayLike | TimedMotion,
        frame: str,
        q0: ArrayLike | None = None,
        *,
        dt: float | None = None,
        velocity_limit: ArrayLike | None = None,
        free: str | Sequence[str] | None = None,
        point: ArrayLike | None = None,
        position_tolerance: float = 1e-6,
        rotation_tolerance: float = 1e-6,
        limit_margin: ArrayLike = 0.0,
        max_step: float = 0.2,
        jumps: bool | None = None,
        max_starts: int = 32,
        rng: np.random.Generator | int = 0,
        avoid: AvoidanceSource | None = None,
        timeout: float | None = None,
    ) -> TrackResult:
        """Return configurations (..., n, nq) that follow `targets`, poses (..., n, 4, 4), continuously.

        `dynx.ik.tracking.track` describes the options. Elsewhere: MoveIt `computeCartesianPath`, TRAC-IK
        called with the previous solution.
        """
        raise NotImplementedError

    @door("dynx.ik.velocity:velocity_ik")
    def velocity_ik(
        self,
        q: ArrayLike,
        tasks: VelocityTask | Sequence[VelocityTask],
        *,
        dt: float,
        damping: float = 1e-6,
        posture: ArrayLike | None = None,
        posture_weight: float = 1e-2,
        posture_gain: float = 1.0,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        v0: ArrayLike | None = None,
        avoid: AvoidanceSource | None = None,
        avoid_gain: float = 5.0,
        timeout: float | None = None,
    ) -> VelocityResult:
        """Return the velocity v (nv,) that meets `tasks` best at q (nq,) and keeps the limits for `dt` [s].

        `dynx.ik.velocity.velocity_ik` describes the options; needs the extra ``qp``. Elsewhere: Pink and mink
        `solve_ik`, Drake `DoDifferentialInverseKinematics`.
        """
        raise NotImplementedError

    def engine_inverse_kinematics(self, T_world_target: ArrayLike, frame: str, q0: ArrayLike) -> Floats:
        """Return the configuration (nq,) at which the engine's own solver stops, for a pose (4, 4) of a frame
        and the start q0 (nq,); the result may miss the target.

        Raises ArgumentError if the engine has no solver of its own.
        """
        raise ArgumentError(
            f"method 'engine': {self!r} has no solver of its own; use method 'dynx', "
            "or the backend 'pybullet'"
        )

    # -- dynamics -----------------------------------------------------------------------------

    def inverse_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
    ) -> Floats:
        """Return the torque tau (..., nv) [N m] that gives acceleration `a`: M a + bias - J' external forces.

        Luh, Walker and Paul 1980. Elsewhere: Pinocchio `rnea`, Drake `CalcInverseDynamics`, MuJoCo
        `mj_inverse`, PyBullet `calculateInverseDynamics`.
        """
        joint_dynamics = joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics)
        tau = self._evaluate("inverse_dynamics", (q, v, a))
        if external_forces is not None:
            tau = tau - self._force_torque(q, tau, external_forces, force_reference)
        if joint_dynamics:
            q, v, a = self._checked_q(q), self._checked_v(v), self._checked_v(a, "a")
            tau = tau + self._joint_terms.passive_torque(q, v) + self._joint_terms.armature_torque(a)
        return tau

    def forward_dynamics(
        self,
        q: ArrayLike,
        v: ArrayLike,
        tau: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
    ) -> Floats:
        """Return the acceleration a (..., nv) [rad/s^2] that `tau` and the external forces give.

        Raises SingularMassMatrixError, which names the joints, if nothing that a joint moves has inertia.

        Featherstone 2008, section 7.3. Elsewhere: Pinocchio `aba`, Drake
        `get_generalized_acceleration_output_port`, MuJoCo `mj_forward`.
        """
        joint_dynamics = joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics)
        if external_forces is None and not joint_dynamics:
            return self._evaluate("forward_dynamics", (q, v, tau))
        q, v = self._checked_q(q), self._checked_v(v)
        tau = self._checked_v(tau, "tau")
        common_batch(q, v, tau)
        self._solvability.refuse_singular(joint_dynamics)
        if external_forces is not None:
            tau = tau + self._force_torque(q, tau, external_forces, force_reference)
        if joint_dynamics:
            tau = tau - self._joint_terms.passive_torque(q, v)
        if not (joint_dynamics and self._joint_terms.has_armature):
            return self._evaluate("forward_dynamics", (q, v, tau))
        M = self.mass_matrix(q, joint_dynamics=joint_dynamics)
        a = solution_or_nan(M, tau - self.bias_torque(q, v))
        return self._arguments.finite_acceleration(a)

    def mass_matrix(self, q: ArrayLike, *, joint_dynamics: bool = False) -> Floats:
        """Return the joint-space inertia matrix M (..., nv, nv) [kg m^2], symmetric.

        Featherstone 2008, section 6.2. Elsewhere: Pinocchio `crba`, Drake `CalcMassMatrix`, MuJoCo
        `mj_fullM`, PyBullet `calculateMassMatrix`.
        """
        joint_dynamics = joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics)
        M = self._evaluate("mass_matrix", (q,))
        return M + self._joint_terms.armature if joint_dynamics else M

    def bias_torque(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
    ) -> Floats:
        """Return C v + g (..., nv) [N m]: `inverse_dynamics` at zero acceleration.

        Siciliano et al., section 7.1.3. Elsewhere: Pinocchio `nonLinearEffects`, MuJoCo `qfrc_bias`, Drake
        `CalcBiasTerm` minus `CalcGravityGeneralizedForces`.
        """
        joint_dynamics = joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics)
        tau = self._evaluate("bias_torque", (q, v))
        if external_forces is not None:
            tau = tau - self._force_torque(q, tau, external_forces, force_reference)
        if joint_dynamics:
            tau = tau + self._joint_terms.passive_torque(self._checked_q(q), self._checked_v(v))
        return tau

    def gravity_torque(self, q: ArrayLike) -> Floats:
        """Return g (..., nv) [N m]: `inverse_dynamics` at rest, the gradient of the potential energy.

        Siciliano et al., section 7.1.3. Elsewhere: Pinocchio `computeGeneralizedGravity`, Drake
        `CalcGravityGeneralizedForces` (with the opposite sign).
        """
        return self._evaluate("gravity_torque", (q,))

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Return C (..., nv, nv) [N m s/rad] with C v + g = bias and dM/dt - 2 C skew-symmetric.

        Echeandia and Wensing 2021, eq. 24 (`dynx.rbd.coriolis`). Elsewhere: Pinocchio
        `computeCoriolisMatrix`.
        """
        return self._evaluate("coriolis_matrix", (q, v))

    def inertial_regressor(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Floats:
        """Return Y (..., nv, 10 n_links) [m/s^2, m^2/s^2, 1/s^2]: inverse dynamics is Y pi.

        pi holds the ten inertial parameters of each link of `model.links`, in order and about the origin of
        the link's frame in its axes: m [kg], m cx, m cy, m cz [kg m], Ixx, Ixy, Ixz, Iyy, Iyz, Izz [kg m^2]
        (`dynx.inertial_parameters` gives the model's own). The columns of links that no coordinate moves are
        zero. Atkeson, An and Hollerbach 1986. Elsewhere: Pinocchio `computeJointTorqueRegressor`, which
        orders the entries of the tensor differently.
        """
        return self._evaluate("inertial_regressor", (q, v, a))

    def joint_wrenches(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        frame: str | None = None,
        reference: str = LOCAL,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
    ) -> Floats:
        """Return the wrenches (..., n_joints, 6) [N, N m] that the parent of each joint exerts on its child:
        force, then moment, in the order of `model.joints`, fixed joints included.

        By default each is at the origin of the joint, in the axes of its child link: the frame of that link
        in the reference ``local``. `frame` names another frame for all, whose point and axes `reference`
        chooses as for a Jacobian. The component along the axis of a joint is its torque of
        `inverse_dynamics`. With mimic joints, the torque of an independent joint is its component, plus the
        component of each follower times the multiplier of the follower. What a joint's damping, friction,
        armature and spring need is not part of it: they act on the side of the motor.

        Featherstone 2008, table 5.1. Elsewhere: Pinocchio `data.f` after `rnea`, Drake
        `get_reaction_forces_output_port`, MuJoCo `cfrc_int` (of each body, about the centre of mass of the
        tree), PyBullet `getJointState` (of a sensor, after a step).
        """
        links = range(1, len(self.model.links))
        wrenches = self._evaluate("joint_wrenches", (q, v, a))
        return self._wrenches(wrenches, q, links, frame, reference, external_forces, force_reference)

    def base_wrench(
        self,
        q: ArrayLike,
        v: ArrayLike,
        a: ArrayLike,
        *,
        frame: str | None = None,
        reference: str = LOCAL,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
    ) -> Floats:
        """Return the wrench (..., 6) [N, N m] that the world exerts on the root link: force, then moment.

        With a fixed base it is what the robot's foundation must bear, with a floating base the first six
        entries of `inverse_dynamics`. The options are those of `joint_wrenches`; by default the wrench is at
        the origin of the base frame, in its axes. Featherstone 2008, table 5.1.
        """
        wrench = self._evaluate("base_wrench", (q, v, a))[..., None, :]
        found = self._wrenches(wrench, q, range(1), frame, reference, external_forces, force_reference)
        return np.asarray(found[..., 0, :])

    # -- the whole body -----------------------------------------------------------------------

    def center_of_mass(self, q: ArrayLike) -> Floats:
        """Return the centre of mass in the world (..., 3) [m]; the base frame's origin if nothing has mass.

        Links fixed to the world count, as they do for the potential energy. Orin, Goswami and Lee 2013.
        Elsewhere: Pinocchio `centerOfMass` (which leaves those links out), Drake
        `CalcCenterOfMassPositionInWorld`, MuJoCo `subtree_com`.
        """
        return self._evaluate("center_of_mass", (q,))

    def center_of_mass_jacobian(self, q: ArrayLike) -> Floats:
        """Return J (..., 3, nv) [m/rad] with J v the velocity of the centre of mass, world axes.

        Orin, Goswami and Lee 2013. Elsewhere: Pinocchio `jacobianCenterOfMass`, Drake
        `CalcJacobianCenterOfMassTranslationalVelocity`, MuJoCo `mj_jacSubtreeCom`.
        """
        return self._evaluate("center_of_mass_jacobian", (q,))

    def centroidal_momentum(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Return the linear, then angular momentum about the centre of mass (..., 6) [kg m/s, kg m^2/s],
        world axes.

        Orin, Goswami and Lee 2013. Elsewhere: Pinocchio `computeCentroidalMomentum`, Drake
        `CalcSpatialMomentumInWorldAboutPoint`, MuJoCo `subtree_angmom`.
        """
        return self._evaluate("centroidal_momentum", (q, v))

    def kinetic_energy(self, q: ArrayLike, v: ArrayLike, *, joint_dynamics: bool = False) -> Floats:
        """Return v' M v / 2 (...,) [J].

        Siciliano et al., section 7.1.1. Elsewhere: Pinocchio `computeKineticEnergy`, Drake
        `CalcKineticEnergy`, MuJoCo `mj_energyVel`.
        """
        energy = self._evaluate("kinetic_energy", (q, v))
        if joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics):
            v = self._checked_v(v)
            energy = energy + 0.5 * np.sum(v * self._joint_terms.armature_torque(v), axis=-1)
        return energy

    def potential_energy(self, q: ArrayLike, *, joint_dynamics: bool = False) -> Floats:
        """Return the energy in the field of gravity (...,) [J], which is zero for mass at the world's origin.

        With `joint_dynamics` it includes the energy of the joints' springs. Siciliano et al., section 7.1.2.
        Elsewhere: Pinocchio `computePotentialEnergy`, Drake `CalcPotentialEnergy`, MuJoCo `mj_energyPos`.
        """
        energy = self._evaluate("potential_energy", (q,))
        if joint_dynamics is not False and checked_bool("joint_dynamics", joint_dynamics):
            energy = energy + self._joint_terms.elastic_energy(self._checked_q(q))
        return energy

    # -- terms that every engine shares -------------------------------------------------------

    def _force_torque(self, q: Any, tau: Any, forces: Forces, reference: str) -> Floats:
        """Return the sum of J' w over the frames and their wrenches w, which broadcast with `tau`."""
        q, wrenches = self._checked_q(q), self._arguments.wrenches(forces)
        common_batch(tau, q, *wrenches.values())
        total: Any = 0.0
        for frame, wrench in wrenches.items():
            J = self.jacobian(q, frame, reference=reference)
            total = total + apply_matrix(np.swapaxes(J, -1, -2), wrench)
        return np.asarray(total)

    def _wrenches(
        self,
        wrenches: Floats,
        q: Any,
        links: range,
        frame: str | None,
        reference: str,
        forces: Forces | None,
        force_reference: str,
    ) -> Floats:
        """Return wrenches on links, which are given in the frames of the links, without external forces and
        in the reference of a frame."""
        axes = self._arguments.reference(reference)
        if forces is None and frame is None and axes == LOCAL:
            return wrenches
        from dynx.rbd.joint_wrenches import AppliedWrench, LinkWrenches

        q = self._checked_q(q)
        T = self.forward_kinematics(q)
        found = LinkWrenches(self._mechanism, links, T[..., : len(self.model.links), :, :], wrenches)
        if forces is not None:
            given = self._arguments.wrenches(forces)
            common_batch(wrenches[..., 0], q, *given.values())
            axes_of_forces = self._arguments.reference(force_reference)
            applied = [(self._index(name), wrench) for name, wrench in given.items()]
            found.subtract(
                AppliedWrench.of(self._link_of_frame[index], T[..., index, :, :], wrench, axes_of_forces)
                for index, wrench in applied
            )
        return found.expressed(axes, None if frame is None else T[..., self._index(frame), :, :])

    @cached_property
    def _link_of_frame(self) -> list[int]:
        """Number of the link that carries each frame."""
        return [self.model.frame_index(frame.link) for frame in self.model.frames]

    def _at_point(
        self, J: Floats, dJ: Floats | None, q: Any, v: Any, frame: str, reference: str, point: Any
    ) -> Floats:
        point = self._arguments.point(point)
        if reference == "world":
            return J if dJ is None else dJ
        R = self.forward_kinematics(q, frame)[..., :3, :3]
        return shift_jacobian(J, dJ, v, R, point, self._arguments.reference(reference))
