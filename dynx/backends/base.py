"""The interface every backend keeps: checked arguments, batches, mimic joints, joint dynamics.

`Backend` turns what a user asks (model coordinates, names, any leading axes) into what an engine
answers (`EngineHooks`: tree coordinates, frame numbers, one sample). The four calls that control
loops make thousands of times a second (forward kinematics of one frame, Jacobian, inverse dynamics,
mass matrix) go to the engine in a straight line when there is one sample and no mimic joint.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.evaluation import Evaluation, common_batch
from dynx.backends.hooks import EngineHooks, apply_matrix, solve_mass_matrix
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.lifecycle import Lifecycle
from dynx.backends.solvability import Solvability
from dynx.ik import IKResult, inverse_kinematics
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference, shift_jacobian
from dynx.spatial.scalar import Floats

Forces = Mapping[str, ArrayLike]


class Backend(Lifecycle, EngineHooks):
    """An engine wrapped: the same questions, conventions and answers whichever engine is behind.

    Arrays are float64 and take leading batch axes, which broadcast: q (..., nq), v, a, tau
    (..., nv). One sample in, one sample out. SI units. Poses are T_world_frame (..., 4, 4).
    Jacobians (..., 6, nv) have linear rows first; `reference` names the axes and the point:

    - ``"local_world_aligned"`` (default): the frame's origin, the world's axes
    - ``"local"``: the frame's origin and axes
    - ``"world"``: the world's origin and axes (the spatial Jacobian)

    `point` (3,) [m], in the frame's axes, moves the origin of the first two.

    `joint_dynamics=True` adds what the description says of the joints, alike in every backend:
    ``armature * a + damping * v + friction * sign(v)`` to the torque, armature to the diagonal of
    the mass matrix. The default is the rigid bodies alone.

    `external_forces` maps frame names to wrenches (..., 6), force [N] then moment [N m], that act
    on the robot, expressed at and in `force_reference` as a Jacobian is.

    A batch is a Python loop over the engine's calls unless the class is `vectorized`; in the backend
    ``reference`` NumPy evaluates it whole. The backend ``compiled`` gives the same numbers for batches, to
    rounding, on UR5 at least about 60 times as fast (to one significant figure, ``dynx bench ur5 --batch
    65536 --threads 1``; docs/bench.md says which backend suits which work).

    Raises errors of `dynx.errors` only. With ``validate=False`` the arguments must be float64
    arrays of the right shape and are not looked at; a wrong one then gives an undefined answer.
    """

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, Arguments(model), validate=validate)
        self._mechanism = model.mechanism
        self._evaluation = Evaluation(self._mechanism, vectorized=self.vectorized)
        self._straight = self._mechanism.coupling is None
        self._joint_terms = JointDynamicsTerms(model)
        self._solvability = Solvability(model)
        self._frame_index = {name: index for index, name in enumerate(model.frame_names)}

    # -- kinematics ---------------------------------------------------------------------------

    def forward_kinematics(self, q: ArrayLike, frame: str | Sequence[str] | None = None) -> Floats:
        """T_world_frame (..., 4, 4); for several frames, or None for all, (..., n, 4, 4)."""
        known: Any = self._arguments.q(q) if self._validate else q
        if isinstance(frame, str):
            index = self._index(frame)
            if self._straight and known.ndim == 1:
                return self._frame_placement(known, index)
            return self._evaluation(self._frame_placement, (4, 4), known, args=(index,))
        placements = self._evaluation(self._frame_placements, (len(self._frame_index), 4, 4), known)
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
        """J (..., 6, nv) with J v the velocity of `frame`, linear [m/s] then angular [rad/s]."""
        known: Any = self._arguments.q(q) if self._validate else q
        axes: Any = self._arguments.reference(reference) if self._validate else reference
        index = self._index(frame)
        if self._straight and point is None and known.ndim == 1:
            return self._jacobian(known, index, axes)
        J = self._evaluation(
            self._jacobian, (6, -1), known, args=(index, axes), reduce=self._evaluation.reduce_rows
        )
        return J if point is None else self._at_point(J, None, known, None, frame, axes, point)

    def jacobian_derivative(
        self,
        q: ArrayLike,
        v: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """dJ/dt (..., 6, nv) along the motion `v`."""
        q, v, axes = self._checked_q(q), self._checked_v(v), self._checked_reference(reference)
        index = self._index(frame)
        dJ = self._evaluation(
            self._jacobian_derivative,
            (6, -1),
            q,
            v,
            args=(index, axes),
            reduce=self._evaluation.reduce_rows,
        )
        if point is None:
            return dJ
        J = self.jacobian(q, frame, reference=reference)
        return self._at_point(J, dJ, q, v, frame, reference, point)

    def frame_velocity(
        self,
        q: ArrayLike,
        v: ArrayLike,
        frame: str,
        *,
        reference: str = LOCAL_WORLD_ALIGNED,
        point: ArrayLike | None = None,
    ) -> Floats:
        """J v (..., 6): linear [m/s] then angular [rad/s] velocity of the frame."""
        q, v, axes = self._checked_q(q), self._checked_v(v), self._checked_reference(reference)
        if point is not None:
            common_batch(q, v)
            return apply_matrix(self.jacobian(q, frame, reference=reference, point=point), v)
        index = self._index(frame)
        return self._evaluation(self._frame_velocity, (6,), q, v, args=(index, axes))

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
        """J a + dJ/dt v (..., 6), the time derivative of `frame_velocity` in the same reference.

        In ``local_world_aligned`` that is the classical acceleration of the frame's origin; in
        ``local`` and ``world`` the spatial acceleration. Gravity has no part in it.
        """
        q, v, axes = self._checked_q(q), self._checked_v(v), self._checked_reference(reference)
        a = self._checked_v(a, "a")
        if point is not None:
            common_batch(q, v, a)
            J = self.jacobian(q, frame, reference=reference, point=point)
            dJ = self.jacobian_derivative(q, v, frame, reference=reference, point=point)
            return apply_matrix(J, a) + apply_matrix(dJ, v)
        index = self._index(frame)
        return self._evaluation(self._frame_acceleration, (6,), q, v, a, args=(index, axes))

    def inverse_kinematics(
        self, target: ArrayLike, frame: str, q0: ArrayLike | None = None, **options: Any
    ) -> IKResult:
        """The configuration that brings `frame` to `target`; see `dynx.ik.inverse_kinematics`."""
        return inverse_kinematics(self, target, frame, q0, **options)

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
        """The torque tau (..., nv) that gives acceleration `a`: M a + bias - J' external forces."""
        known: Any = self._arguments.q(q) if self._validate else q
        speed: Any = self._arguments.v(v) if self._validate else v
        wanted: Any = self._arguments.v(a, "a") if self._validate else a
        if self._straight and known.ndim == 1 and speed.ndim == 1 and wanted.ndim == 1:
            tau = self._inverse_dynamics(known, speed, wanted)
        else:
            tau = self._evaluation(
                self._inverse_dynamics, (-1,), known, speed, wanted, reduce=self._evaluation.reduce_rows
            )
        if external_forces is not None:
            tau = tau - self._force_torque(known, tau, external_forces, force_reference)
        if joint_dynamics:
            tau = tau + self._joint_terms.losses(speed) + self._joint_terms.rotor_torque(wanted)
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
        """The acceleration a (..., nv) that `tau` and the external forces give.

        Raises SingularMassMatrixError, which names the joints, where a joint moves no inertia.
        """
        q, v = self._checked_q(q), self._checked_v(v)
        tau = self._checked_v(tau, "tau")
        common_batch(q, v, tau)
        self._solvability.refuse_singular(joint_dynamics)
        if external_forces is not None:
            tau = tau + self._force_torque(q, tau, external_forces, force_reference)
        if joint_dynamics:
            tau = tau - self._joint_terms.losses(v)
        if self._straight and not (joint_dynamics and self._joint_terms.has_rotors):
            a = self._evaluation(self._forward_dynamics, (-1,), q, v, tau)
        else:
            M = self.mass_matrix(q, joint_dynamics=joint_dynamics)
            a = solve_mass_matrix(M, tau - self.bias_torque(q, v))
        return self._arguments.finite_acceleration(a)

    def mass_matrix(self, q: ArrayLike, *, joint_dynamics: bool = False) -> Floats:
        """M (..., nv, nv), symmetric."""
        known: Any = self._arguments.q(q) if self._validate else q
        if self._straight and known.ndim == 1:
            M = self._mass_matrix(known)
        else:
            M = self._evaluation(self._mass_matrix, (-1, -1), known, reduce=self._evaluation.reduce_both)
        return M + self._joint_terms.rotors if joint_dynamics else M

    def bias_torque(
        self,
        q: ArrayLike,
        v: ArrayLike,
        *,
        external_forces: Forces | None = None,
        force_reference: str = LOCAL_WORLD_ALIGNED,
        joint_dynamics: bool = False,
    ) -> Floats:
        """C v + g (..., nv): `inverse_dynamics` at zero acceleration."""
        q, v = self._checked_q(q), self._checked_v(v)
        tau = self._evaluation(self._bias_torque, (-1,), q, v, reduce=self._evaluation.reduce_rows)
        if external_forces is not None:
            tau = tau - self._force_torque(q, tau, external_forces, force_reference)
        return tau + self._joint_terms.losses(v) if joint_dynamics else tau

    def gravity_torque(self, q: ArrayLike) -> Floats:
        """g (..., nv): `inverse_dynamics` at rest, the gradient of the potential energy."""
        q = self._checked_q(q)
        return self._evaluation(self._gravity_torque, (-1,), q, reduce=self._evaluation.reduce_rows)

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """C (..., nv, nv) with C v + g = bias and dM/dt - 2 C skew-symmetric (`dynx.rbd.coriolis`)."""
        q, v = self._checked_q(q), self._checked_v(v)
        return self._evaluation(self._coriolis_matrix, (-1, -1), q, v, reduce=self._evaluation.reduce_both)

    def inertial_regressor(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> Floats:
        """Y (..., nv, 10 n_links): inverse dynamics is Y pi, with pi the links' inertial parameters.

        The ten of each link of `model.links`, in order and about the origin of the link's frame in its
        axes: m [kg], m cx, m cy, m cz [kg m], Ixx, Ixy, Ixz, Iyy, Iyz, Izz [kg m^2]
        (`dynx.inertial_parameters` gives the model's own). Links that no coordinate moves have zeros.
        """
        q, v, a = self._checked_q(q), self._checked_v(v), self._checked_v(a, "a")
        tail = (-1, 10 * len(self.model.links))
        return self._evaluation(
            self._inertial_regressor, tail, q, v, a, reduce=self._evaluation.reduce_leading
        )

    # -- the whole body -----------------------------------------------------------------------

    def center_of_mass(self, q: ArrayLike) -> Floats:
        """Centre of mass in the world (..., 3) [m]; the base frame's origin if nothing has mass.

        Links that are bolted to the world count, as they do for the potential energy (Pinocchio's own
        `centerOfMass` leaves them out).
        """
        q = self._checked_q(q)
        return self._evaluation(self._center_of_mass, (3,), q)

    def center_of_mass_jacobian(self, q: ArrayLike) -> Floats:
        """J (..., 3, nv) with J v the velocity of the centre of mass, world axes."""
        q = self._checked_q(q)
        return self._evaluation(
            self._center_of_mass_jacobian, (3, -1), q, reduce=self._evaluation.reduce_rows
        )

    def centroidal_momentum(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Linear [kg m/s] then angular [kg m^2/s] momentum about the centre of mass (..., 6)."""
        q, v = self._checked_q(q), self._checked_v(v)
        return self._evaluation(self._centroidal_momentum, (6,), q, v)

    def kinetic_energy(self, q: ArrayLike, v: ArrayLike, *, joint_dynamics: bool = False) -> Floats:
        """v' M v / 2 (...,) [J]."""
        q, v = self._checked_q(q), self._checked_v(v)
        energy = self._evaluation(self._kinetic_energy, (), q, v)
        if joint_dynamics:
            energy = energy + 0.5 * np.sum(v * self._joint_terms.rotor_torque(v), axis=-1)
        return energy

    def potential_energy(self, q: ArrayLike) -> Floats:
        """Energy in the field of gravity (...,) [J], zero with the mass at the world's origin."""
        q = self._checked_q(q)
        return self._evaluation(self._potential_energy, (), q)

    # -- from questions to hooks --------------------------------------------------------------

    def _index(self, frame: str) -> int:
        try:
            return self._frame_index[frame]
        except (KeyError, TypeError):
            return self.model.frame_index(frame)

    def _checked_q(self, q: Any) -> Floats:
        return self._arguments.q(q) if self._validate else q

    def _checked_v(self, v: Any, name: str = "v") -> Floats:
        return self._arguments.v(v, name) if self._validate else v

    def _checked_reference(self, reference: Any) -> Reference:
        return self._arguments.reference(reference) if self._validate else reference

    def _force_torque(self, q: Any, tau: Any, forces: Forces, reference: str) -> Floats:
        """J' w summed over the frames that a wrench acts on, to be added to or taken from `tau`."""
        wrenches = self._arguments.wrenches(forces)
        common_batch(tau, q, *wrenches.values())
        total: Any = 0.0
        for frame, wrench in wrenches.items():
            J = self.jacobian(q, frame, reference=reference)
            total = total + apply_matrix(np.swapaxes(J, -1, -2), wrench)
        return np.asarray(total)

    def _at_point(
        self, J: Floats, dJ: Floats | None, q: Any, v: Any, frame: str, reference: str, point: Any
    ) -> Floats:
        point = self._arguments.point(point)
        if reference == "world":
            return J if dJ is None else dJ
        R = self.forward_kinematics(q, frame)[..., :3, :3]
        return shift_jacobian(J, dJ, v, R, point, self._arguments.reference(reference))
