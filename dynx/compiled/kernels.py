"""What the compiled backend compiles: for each quantity, the function of `dynx.rbd` that is traced.

A kernel has the arguments of its quantity as inputs and two outputs: the answer, and a ``defect``
that is below `SOUND` exactly if the arguments are finite, not too large, and of unit length where
they are a quaternion, and the answer is finite where it might not be. So arguments are checked while
they are in the processor's registers anyway.

Mimic joints are traced with the rest: a kernel works in the coordinates of the model, unless those of
the tree are asked for.

Placements of frames have the frames folded in as constants, for most programs ask for one. Other
quantities of frames have kernels that many frames share (`dynx.compiled.frames`). Which
kernel answers depends on the question alone, so no answer depends on what was asked before.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

import dynx.model.configuration
import dynx.model.mechanism
import dynx.rbd
import dynx.spatial
from dynx._version import __version__
from dynx.compiled import frames as compiled_frames
from dynx.compiled.frames import Chain, on_chain
from dynx.model import Mechanism
from dynx.model.configuration import TOO_LARGE, UNIT
from dynx.model.mechanism import Coupling
from dynx.rbd import aba, centroidal, coriolis, crba, jacobians, kinematics, regressor, rnea
from dynx.rbd.aba import inertia_matrix
from dynx.rbd.base_parameters import align_frames, regroup_inertias
from dynx.rbd.jacobians import Reference
from dynx.rbd.kinematics import body_poses
from dynx.rbd.linear import solve_positive_definite
from dynx.simd.cache import cached_kernel, source_hash
from dynx.simd.emit import Settings
from dynx.simd.kernel import Kernel
from dynx.simd.program import Program
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous

SOUND = TOO_LARGE**2
"""Bound on the defect of a sample whose arguments can be answered."""

LARGEST = 1e300
"""Bound on the answers of quantities that divide; no acceleration of a robot is larger."""

LONGEST = 1000
"""Bound on the size of a quantity's code, as its `size` measures it: some 20 seconds of compiling."""

SHORT = 600
"""Length of the segments (`dynx.simd.emit`) of code of cubic size: two thirds of the time to
compile, and as fast to within an eighth."""

Answer = Callable[..., Array]


def _linear(mechanism: Mechanism) -> int:
    """Code that grows with the number of joints."""
    return 4 * mechanism.nv


def _pairwise(mechanism: Mechanism) -> int:
    """Code that grows with the number of pairs of joints of which one carries the other."""
    return sum(len(kinematics.ancestry(mechanism, body)) for body in range(len(mechanism.bodies)))


def _cubic(mechanism: Mechanism) -> int:
    """Code that multiplies a matrix for every body."""
    return len(mechanism.bodies) * mechanism.nv**2


@dataclass(frozen=True)
class Quantity:
    """A function of `dynx.rbd`: of the mechanism, the named arguments, and details such as a frame.

    `columns` and `rows` say which axes of the answer belong to velocities, which mimic joints reduce.
    `rank` is the answer's number of axes; `size` measures the code; beyond `LONGEST` NumPy evaluates.
    With `divides`, the answer is not finite in some states, and the defect says so as well.
    """

    arguments: tuple[str, ...]
    function: Answer
    rank: int
    columns: bool = False
    rows: bool = False
    size: Callable[[Mechanism], int] = _linear
    divides: bool = False


def _placement(mechanism: Mechanism, q: Array, frame: int) -> Array:
    return homogeneous(*kinematics.frame_pose(mechanism, body_poses(mechanism, q), frame))


def _placements(mechanism: Mechanism, q: Array, *frames: int) -> Array:
    poses = body_poses(mechanism, q)
    shape = (*q.shape[:-1], 4, 4)
    found = [homogeneous(*kinematics.frame_pose(mechanism, poses, frame)) for frame in frames]
    return np.stack([np.broadcast_to(T, shape) for T in found], axis=-3) if found else np.zeros((0, 4, 4))


def _jacobian(mechanism: Mechanism, q: Array, frame: int, reference: Reference) -> Array:
    return jacobians.frame_jacobian(mechanism, body_poses(mechanism, q), frame, reference)


def _jacobian_derivative(mechanism: Mechanism, q: Array, v: Array, frame: int, reference: Reference) -> Array:
    return jacobians.frame_jacobian_derivative(mechanism, body_poses(mechanism, q), v, frame, reference)


def _frame_velocity(mechanism: Mechanism, q: Array, v: Array, frame: int, reference: Reference) -> Array:
    return _applied(_jacobian(mechanism, q, frame, reference), v)


def _frame_acceleration(
    mechanism: Mechanism, q: Array, v: Array, a: Array, frame: int, reference: Reference
) -> Array:
    moved = _applied(_jacobian(mechanism, q, frame, reference), a)
    return moved + _applied(_jacobian_derivative(mechanism, q, v, frame, reference), v)


def _inverse_dynamics(mechanism: Mechanism, q: Array, v: Array, a: Array) -> Array:
    return rnea.inverse_dynamics(regroup_inertias(mechanism), q, v, a)


def _bias_torque(mechanism: Mechanism, q: Array, v: Array) -> Array:
    return _inverse_dynamics(mechanism, q, v, np.zeros(v.shape))


def _gravity_torque(mechanism: Mechanism, q: Array) -> Array:
    rest = np.zeros((*q.shape[:-1], mechanism.nv))
    return _inverse_dynamics(mechanism, q, rest, rest)


def _inertial_regressor(mechanism: Mechanism, q: Array, v: Array, a: Array, links: int) -> Array:
    # The frames of the links come first.
    return regressor.inertial_regressor(mechanism, body_poses(mechanism, q), v, a, range(links))


def _of_poses(function: Answer) -> Answer:
    return lambda mechanism, q, *rest: function(mechanism, body_poses(mechanism, q), *rest)


def _applied(A: Array, x: Array) -> Array:
    return np.asarray((A @ x[..., None])[..., 0])


QUANTITIES: dict[str, Quantity] = {
    "frame_placement": Quantity(("q",), _placement, 2),
    "frame_placements": Quantity(("q",), _placements, 3),
    "jacobian": Quantity(("q",), _jacobian, 2, columns=True),
    "jacobian_derivative": Quantity(("q", "v"), _jacobian_derivative, 2, columns=True),
    "frame_velocity": Quantity(("q", "v"), _frame_velocity, 1),
    "frame_acceleration": Quantity(("q", "v", "a"), _frame_acceleration, 1),
    "inverse_dynamics": Quantity(("q", "v", "a"), _inverse_dynamics, 1, columns=True),
    "forward_dynamics": Quantity(("q", "v", "tau"), aba.forward_dynamics, 1, divides=True),
    "mass_matrix": Quantity(("q",), crba.mass_matrix, 2, columns=True, rows=True, size=_pairwise),
    "bias_torque": Quantity(("q", "v"), _bias_torque, 1, columns=True),
    "gravity_torque": Quantity(("q",), _gravity_torque, 1, columns=True),
    "coriolis_matrix": Quantity(
        ("q", "v"), coriolis.coriolis_matrix_at, 2, columns=True, rows=True, size=_pairwise
    ),
    "inertial_regressor": Quantity(("q", "v", "a"), _inertial_regressor, 2, rows=True, size=_cubic),
    "center_of_mass": Quantity(("q",), _of_poses(centroidal.center_of_mass), 1),
    "center_of_mass_jacobian": Quantity(
        ("q",), _of_poses(centroidal.center_of_mass_jacobian), 2, columns=True
    ),
    "centroidal_momentum": Quantity(("q", "v"), _of_poses(centroidal.centroidal_momentum), 1),
    "kinetic_energy": Quantity(("q", "v"), _of_poses(centroidal.kinetic_energy), 0),
    "potential_energy": Quantity(("q",), _of_poses(centroidal.potential_energy), 0),
}
"""Every quantity, by the name of the hook that answers it."""


def compiles(mechanism: Mechanism, name: str) -> bool:
    """Whether a quantity of this mechanism is compiled, rather than evaluated by NumPy."""
    return QUANTITIES[name].size(mechanism) <= LONGEST


def rank(name: str) -> int:
    """Number of axes of one sample's answer."""
    return QUANTITIES[name].rank


ON_CHAINS = frozenset({"jacobian", "jacobian_derivative", "frame_velocity", "frame_acceleration"})
"""Quantities whose kernels serve many frames."""


def evaluated(
    mechanism: Mechanism, name: str, details: tuple[Any, ...], q: Array, *rates: Array, tree: bool = False
) -> Array:
    """A quantity on arrays (..., nq) and (..., nv) of numbers or of symbols.

    They are in the coordinates of the model or, with `tree`, of the mechanism itself.
    """
    quantity = QUANTITIES[name]

    def of_tree(q: Array, *rates: Array) -> Array:
        return np.asarray(quantity.function(mechanism, q, *rates, *details))

    coupling = None if tree else mechanism.coupling
    if name == "forward_dynamics" and coupling is not None:
        # The inertia that the drivers feel is not that of a tree.
        S, (v, tau) = coupling.matrix(), rates
        q = coupling.expand_q(q)
        M = S.T @ crba.mass_matrix(mechanism, q) @ S
        return np.asarray(solve_positive_definite(M, tau - _bias_torque(mechanism, q, v @ S.T) @ S))
    return _coupled(coupling, quantity, of_tree, q, *rates)


def _coupled(
    coupling: Coupling | None, quantity: Quantity, of_tree: Answer, q: Array, *rates: Array
) -> Array:
    """`of_tree`, a quantity in the coordinates of the tree, in those that mimic joints leave."""
    if coupling is None:
        return of_tree(q, *rates)
    S = coupling.matrix()
    answer = of_tree(coupling.expand_q(q), *(rate @ S.T for rate in rates))
    if quantity.columns:
        answer = answer @ S
    return np.asarray(S.T @ answer if quantity.rows else answer)


def quantity_kernel(
    mechanism: Mechanism, name: str, details: tuple[Any, ...], *, tree: bool = False
) -> Kernel:
    """The kernel of a quantity, from the cache if it was compiled before."""

    def answer(q: Array, *rates: Array) -> Array:
        return evaluated(mechanism, name, details, q, *rates, tree=tree)

    recipe = _recipe(mechanism, name, details, tree)
    lanes = host().lanes
    settings = Settings(lanes, segment=SHORT) if QUANTITIES[name].size is _cubic else Settings(lanes)
    return cached_kernel(recipe, lambda: _program(mechanism, name, answer, tree=tree), settings=settings)


def chain_kernel(mechanism: Mechanism, name: str, chain: Chain, *, tree: bool = False) -> Kernel:
    """The kernel of a quantity for the frames of a chain; its last input is the place of one."""
    coupling = None if tree else mechanism.coupling

    def answer(q: Array, *rates_and_place: Array) -> Array:
        *rates, place = rates_and_place
        of_tree = partial(on_chain, mechanism, name, chain, place)
        return _coupled(coupling, QUANTITIES[name], of_tree, q, *rates)

    recipe = _recipe(mechanism, name, chain, tree)
    return cached_kernel(
        recipe, lambda: _program(mechanism, name, answer, tree=tree, place=(chain.place_size,))
    )


def _recipe(mechanism: Mechanism, name: str, details: object, tree: bool) -> bytes:
    return repr((_algorithms(), _fingerprint(mechanism), name, details, tree)).encode()


def _program(
    mechanism: Mechanism, name: str, answer: Answer, *, tree: bool, **more: tuple[int, ...]
) -> Program:
    """The program of `answer`, of the quantity's arguments and inputs `more` that need no checking."""
    coupled = mechanism.coupling if not tree else None
    base_q, base_v = (7, 6) if mechanism.floating else (0, 0)
    joints = len(mechanism.bodies) if coupled is None else coupled.n_joints
    checked = QUANTITIES[name].arguments

    def answer_and_defect(**inputs: Array) -> dict[str, Array]:
        found = answer(*inputs.values())
        defect = _defect(mechanism, *(inputs[argument] for argument in checked))
        if QUANTITIES[name].divides:
            defect = defect + np.sum(abs(found)) * (SOUND / LARGEST)
        return {"answer": found, "defect": defect}

    shapes = {argument: (base_q + joints if argument == "q" else base_v + joints,) for argument in checked}
    return trace(answer_and_defect, {**shapes, **more})


def _defect(mechanism: Mechanism, q: Array, *rates: Array) -> Array:
    """Sum of the squares of all arguments; far above `SOUND` if a quaternion is not of unit length."""
    numbers = np.concatenate([q, *rates])
    total = _sum_by_pairs([x * x for x in numbers])
    if mechanism.floating:
        off = abs(sum(x * x for x in q[3:7]) - 1.0)
        total = total + (off - UNIT).maximum(0.0) * (SOUND * 1e100)
    return np.array([total], dtype=object)


def _sum_by_pairs(terms: list[Any]) -> Any:
    """A sum in which few additions wait for one another, which a processor likes."""
    while len(terms) > 1:
        odd = terms[len(terms) // 2 * 2 :]
        terms = [a + b for a, b in zip(terms[::2], terms[1::2], strict=False)] + odd
    return terms[0] if terms else 0.0


def tidied(mechanism: Mechanism) -> Mechanism:
    """The mechanism with the fewest numbers: frames along the axes, no dust in rotation matrices.

    A right angle in a file becomes cos(pi/2) = 6e-17 where 0 was meant. Entries below half the
    spacing of doubles at 1 are smaller than the rounding of the entries of order 1 beside them, so to
    leave them out changes a rotation by no more than it is uncertain anyway; but each would cost a
    multiplication in all that it is part of.

    Inverse dynamics takes the inertias by base parameters as well (`dynx.rbd.base_parameters`). Forward
    dynamics does not: it would be a tenth faster and, on some robots, a hundred times less accurate.
    """
    return _without_dust(align_frames(_without_dust(mechanism)))


def _without_dust(mechanism: Mechanism) -> Mechanism:
    return replace(
        mechanism,
        bodies=tuple(replace(body, R=_undusted(body.R)) for body in mechanism.bodies),
        frames=tuple(replace(frame, R=_undusted(frame.R)) for frame in mechanism.frames),
    )


def _undusted(R: Floats) -> Floats:
    return np.where(np.abs(R) < 0.5 * np.finfo(np.float64).eps, 0.0, R)


def is_physical(mechanism: Mechanism) -> bool:
    """Whether every body's inertia is positive semidefinite; then every mass matrix is too.

    Elimination without pivoting is then as accurate as the matrix allows.
    """
    inertias = [mechanism.root, *(body.inertia for body in mechanism.bodies)]
    values = [np.linalg.eigvalsh(inertia_matrix(inertia)) for inertia in inertias]
    return all(v[0] >= -8 * np.finfo(np.float64).eps * abs(v[-1]) for v in values)


@cache
def _algorithms() -> str:
    """Hash of the text of all that a traced function runs through."""
    folders = [Path(str(package.__file__)).parent for package in (dynx.rbd, dynx.spatial)]
    modules = [dynx.model.configuration.__file__, dynx.model.mechanism.__file__]
    modules += [compiled_frames.__file__, __file__]
    return f"{__version__} {np.__version__} {source_hash(*folders, *map(Path, modules))}"


def _fingerprint(mechanism: Mechanism) -> str:
    """Hash of every field of a mechanism, numbers to the last bit."""
    digest = sha256()

    def feed(value: Any) -> None:
        if isinstance(value, (np.ndarray, np.generic)):
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(value.tobytes())
        elif isinstance(value, (bool, int, float, str)) or value is None:
            digest.update(f"{type(value).__name__} {value!r};".encode())
        elif isinstance(value, tuple):
            digest.update(b"(%d" % len(value))
            for each in value:
                feed(each)
        else:
            # Another kind of field than a dataclass would raise here, rather than be left out.
            for field in fields(value):
                feed(getattr(value, field.name))

    feed(mechanism)
    return digest.hexdigest()
