"""The law of joint friction (`dynx.sim.plants.friction_law`) for one robot and one step at a time."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from dynx.sim.plants.friction_law import TOLERANCE, FrictionLaw
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.simplify import STRICT
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats

MAX_COMPILED_OPERATIONS = 8000
"""Number of products in one solution above which NumPy takes less time than compilation is worth."""

BLOCK_CORRECTIONS = 8
"""Number of solutions after which modes are corrected one at a time."""

MAX_SOLUTIONS = 256
"""Number of solutions in one step; only a mass matrix that is not positive definite may need more."""


class FrictionSolver:
    """Velocities at the end of a step under dry friction, by solutions of the law in a compiled kernel.

    Results depend on the arguments alone. Not safe for several threads at a time.
    """

    def __init__(self, law: FrictionLaw, friction: Floats, h: float) -> None:
        """`friction` (nv,) [N m or N] of the coordinates, `h` [s] the length of a step."""
        self.law = law
        self._joints = list(law.joints)
        n, nv = len(law.joints), len(law.below)
        self._friction: Floats = friction[self._joints]
        self._h = h
        self._inertia = np.array(law.inertia)
        self._all_move = np.ones(nv)
        self._kernel = None
        if law.operations <= MAX_COMPILED_OPERATIONS:
            space = self._kernel = _kernel(law.joints, law.below).workspace()
            self._A, self._r, self._v, _, _, self._modes, self._single = space.input_slices[:7]
            self._numbers: Any = space.inputs
            for port, value in ((3, self._friction), (4, self._inertia), (7, h)):
                space.input_rows[port][:] = value
            found = space.results
            self._a, self._moves, self._torque, self._corrected = found[:4]
            self._changes: Any = space.output_rows[4][:1, 0].data
        self.torque: Floats = np.zeros(n)
        """Torque (n,) of dry friction on the joints of the law in the last step."""

    def step(self, A: Floats, r: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return the acceleration (nv,) from velocity `v`, and 1 for coordinates that move, 0 for those that
        stick, (nv,).

        `A` (nv, nv) is the mass matrix plus h times the damping; `r` (nv,) the torque without dry friction.
        """
        modes = np.sign(v[self._joints])
        for count in range(MAX_SOLUTIONS):
            corrected = self._solve(A, r, v, modes, 0.0 if count < BLOCK_CORRECTIONS else 1.0)
            if corrected is None:
                break
            modes = corrected
        a, moves = self._a.copy(), self._moves.copy()
        return a, moves

    def with_modes(self, A: Floats, r: Floats, v: Floats, modes: Floats) -> Floats:
        """Return the acceleration (nv,) with modes (n,) that are not corrected; joints that stick reach
        velocity 0 from `v` after h."""
        self._solve(A, r, v, modes, 0.0)
        a: Floats = self._a.copy()
        return a

    def _solve(self, A: Floats, r: Floats, v: Floats, modes: Floats, single: float) -> Floats | None:
        """Solve the law for given modes; return corrected modes, or None if they are right."""
        if self._kernel is None:
            return self._solve_densely(A, r, v, modes, single)
        numbers = self._numbers
        numbers[self._A] = A.reshape(-1)
        numbers[self._r], numbers[self._v], numbers[self._modes] = r, v, modes
        numbers[self._single.start] = single
        self._kernel.run()
        self.torque = self._torque
        # NaN counts as right: the simulation diverged.
        return self._corrected.copy() if self._changes[0] > 0.0 else None

    def _solve_densely(self, A: Floats, r: Floats, v: Floats, modes: Floats, single: float) -> Floats | None:
        joints, h, friction = self._joints, self._h, self._friction
        moves, sliding = self._all_move.copy(), np.zeros(len(v))
        moves[joints], sliding[joints] = np.abs(modes), modes * friction
        stuck, free = moves == 0.0, moves != 0.0
        a = np.where(stuck, -v / h, 0.0)
        rest = r - sliding - A @ a
        a[free] = np.linalg.solve(A[np.ix_(free, free)], rest[free])
        left = (r - A @ a)[joints]
        self._a, self._moves = a, moves
        self.torque = np.where(moves[joints] == 0.0, left, modes * friction)
        speed = moves[joints] * (v + h * a)[joints]
        wanted = self.torque + speed * self._inertia / h
        bound = friction * (1.0 + TOLERANCE)
        change = np.sign(wanted - np.clip(wanted, -bound, bound)) - modes
        wrong = np.flatnonzero(change)
        if not wrong.size or not np.isfinite(a).all():
            return None
        corrected = modes + np.clip(change, single - 2.0, 2.0 - single)
        if single:
            corrected[wrong[:-1]] = modes[wrong[:-1]]
        return np.asarray(corrected)


@cache
def _kernel(joints: tuple[int, ...], below: tuple[tuple[int, ...], ...]) -> Kernel:
    """Compile one solution of the law; coefficients, step and estimated inertias are inputs."""
    n, nv = len(joints), len(below)
    law = FrictionLaw(joints, below, (0.0,) * n)

    def solution(**given: Array) -> dict[str, Array]:
        found = law.solve(
            given["A"],
            given["r"],
            given["v"],
            given["friction"],
            given["h"][0],
            given["modes"],
            given["one_by_one"][0],
            given["inertia"],
        )
        return {**found._asdict(), "changes": np.array([found.changes], dtype=object)}

    sizes: dict[str, tuple[int, ...]] = {"A": (nv, nv), "r": (nv,), "v": (nv,)}
    sizes |= {"friction": (n,), "inertia": (n,), "modes": (n,), "one_by_one": (1,), "h": (1,)}
    program = trace(solution, sizes, simplify=STRICT)
    return load_kernel(program_recipe(program), lambda: program, settings=Settings(host().lanes, fast=False))
