"""Programs of derivatives for one mechanism.

They are differentiated graphs of the algorithms of `dynx.rbd`, or its closed form where that is shorter.
"""

from __future__ import annotations

import numpy as np

from dynx.compiled.model_coordinates import (
    argument_shapes,
    reduce_columns,
    reduce_rows,
    tree_coordinates,
)
from dynx.model import Mechanism
from dynx.rbd import derivatives, kinematics, rnea
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.elimination import factorize_mass_matrix, filled_entries, solve_with_factors
from dynx.simd.differentiate import differentiate
from dynx.simd.program import Program
from dynx.simd.trace import inline, trace
from dynx.spatial.manifold import displace
from dynx.spatial.scalar import Array
from dynx.spatial.se3 import homogeneous

MAX_DIFFERENTIATED_PAIRS = 40
"""Number of pairs of a joint and an ancestor up to which differentiating the algorithm gives shorter code for
a robot with a fixed base, because the poses of its few joints have many zeros."""


def inverse_dynamics_derivatives(mechanism: Mechanism) -> Program:
    """Return the program of q, v and a, with the outputs dtau_dq, dtau_dv and dtau_da, each (nv, nv)."""
    shapes = argument_shapes(mechanism, "qva")
    if not mechanism.floating and pair_count(mechanism) <= MAX_DIFFERENTIATED_PAIRS:
        program = _differentiated_torque(mechanism)
        return trace(lambda q, v, a: _torque_derivatives(program, q, v, a), shapes)
    return trace(lambda q, v, a: _closed_form(mechanism, q, v, a), shapes)


def pair_count(mechanism: Mechanism) -> int:
    """Return the number of pairs of a joint and an ancestor, itself and coordinates of the base included."""
    base = mechanism.nv - len(mechanism.bodies)
    return sum(len(kinematics.ancestry(mechanism, body)) + base for body in range(len(mechanism.bodies)))


def forward_dynamics_derivatives(mechanism: Mechanism) -> Program:
    """Return the program of q, v and tau, with the outputs da_dq, da_dv and da_dtau, each (nv, nv)."""
    program = _differentiated_torque(mechanism)

    def implicit_derivatives(q: Array, v: Array, tau: Array) -> dict[str, Array]:
        # By the implicit function theorem. M = dtau/da does not depend on the acceleration.
        zero = np.zeros(len(v))
        L, D = factorize_mass_matrix(mechanism, _torque_derivatives(program, q, v, zero)["dtau_da"])
        a = solve_with_factors(L, D, tau - _torque(mechanism, q, v, zero))
        found = _torque_derivatives(program, q, v, a)
        sides = {"da_dq": -found["dtau_dq"], "da_dv": -found["dtau_dv"], "da_dtau": np.eye(len(v), dtype=int)}
        return {name: solve_with_factors(L, D, side.T).T for name, side in sides.items()}

    return trace(implicit_derivatives, argument_shapes(mechanism, ("q", "v", "tau")))


def factors_of_mass(mechanism: Mechanism) -> Program:
    """Return the program of M (nv, nv) with the non-zero entries of the factors L and D as output."""
    nv, filled = filled_entries(mechanism)

    def factors(M: Array) -> Array:
        L, D = factorize_mass_matrix(mechanism, M)
        return np.array([np.asarray(x)[()] for x in (*(L[i][j] for i, j in filled), *D)], dtype=object)

    return trace(factors, {"M": (nv, nv)})


def solution_by_factors(mechanism: Mechanism) -> Program:
    """Return the program of the output of `factors_of_mass` and b (nv,), with the output M^-1 b."""
    nv, filled = filled_entries(mechanism)

    def solution(factors: Array, b: Array) -> Array:
        L: list[dict[int, Array]] = [{} for _ in range(nv)]
        for (i, j), entry in zip(filled, factors, strict=False):
            L[i][j] = entry
        return solve_with_factors(L, list(factors[len(filled) :]), b)

    return trace(solution, {"factors": (len(filled) + nv,), "b": (nv,)})


def pose_derivative(mechanism: Mechanism, frame: int) -> Program:
    """Return the program of q, with the output dT_dq (4, 4, nv) for frame number `frame`."""
    shapes = argument_shapes(mechanism, "qv")

    def pose(q: Array, d: Array) -> dict[str, Array]:
        (tree,) = tree_coordinates(mechanism, _displaced(mechanism, q, d))
        poses = kinematics.body_poses(mechanism, tree)
        return {"T": homogeneous(*kinematics.frame_pose(mechanism, poses, frame))}

    program = differentiate(trace(pose, {"q": shapes["q"], "d": shapes["v"]}), [("T", "d")], order="forward")
    still = np.zeros(shapes["v"])
    return trace(lambda q: {"dT_dq": inline(program, {"q": q, "d": still})["dT_dd"]}, {"q": shapes["q"]})


def _displaced(mechanism: Mechanism, q: Array, d: Array) -> Array:
    return displace(q, d, floating=mechanism.floating, balls=mechanism.ball_places)


def _closed_form(mechanism: Mechanism, q: Array, v: Array, a: Array) -> dict[str, Array]:
    found = derivatives.inverse_dynamics_derivatives(mechanism, *tree_coordinates(mechanism, q, v, a))
    reduced = (reduce_rows(mechanism, reduce_columns(mechanism, matrix)) for matrix in found)
    dtau_dq, dtau_dv, M = reduced
    return {"dtau_dq": dtau_dq, "dtau_dv": dtau_dv, "dtau_da": _symmetric(M)}


def _torque(mechanism: Mechanism, q: Array, v: Array, a: Array) -> Array:
    tau = rnea.inverse_dynamics(regroup_inertias(mechanism), *tree_coordinates(mechanism, q, v, a))
    return reduce_columns(mechanism, tau)


def _differentiated_torque(mechanism: Mechanism) -> Program:
    """Return the program of the derivatives of the torque by a displacement d of q, by v and by a.

    Reverse mode is used, because there are more arguments than torques.
    """

    def torque(q: Array, d: Array, v: Array, a: Array) -> dict[str, Array]:
        return {"tau": _torque(mechanism, _displaced(mechanism, q, d), v, a)}

    shapes = argument_shapes(mechanism, "qva")
    moved = {"q": shapes["q"], "d": shapes["v"], "v": shapes["v"], "a": shapes["a"]}
    return differentiate(trace(torque, moved), [("tau", x) for x in ("d", "v", "a")], order="reverse")


def _torque_derivatives(program: Program, q: Array, v: Array, a: Array) -> dict[str, Array]:
    """Return the outputs of `_differentiated_torque` at d = 0; only one triangle of M is computed."""
    found = inline(program, {"q": q, "d": np.zeros(len(v)), "v": v, "a": a})
    M = _symmetric(found["dtau_da"])
    return {"dtau_dq": found["dtau_dd"], "dtau_dv": found["dtau_dv"], "dtau_da": M}


def _symmetric(M: Array) -> Array:
    """Return the symmetric matrix with the lower triangle of `M`, whose upper one is then never computed."""
    M = np.array(M)
    for i, j in zip(*np.triu_indices(len(M), 1), strict=True):
        M[i, j] = M[j, i]
    return M
