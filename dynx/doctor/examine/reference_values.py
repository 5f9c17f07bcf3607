"""Reference values for a file: the robot as dynx reads it, evaluated by the algorithms of `dynx.rbd`.

Coordinates are those of all moving joints, mimic joints included, as engines load them: the ``<mimic>`` tags
are removed. Gravity is tilted, so that a value in the wrong frame differs. ``dynx agree`` compares the
backend `reference`, which evaluates here, with a 50-digit referee.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from dynx.agreement.referee import Referee
from dynx.agreement.tolerances import BAR
from dynx.backends.solvability import singular_coordinates
from dynx.model import Model
from dynx.model.elements import Vector
from dynx.model.loading import read_model
from dynx.model.tree import Base
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

TILTED_GRAVITY: Vector = (0.3, -0.7, -9.81)
"""Gravity [m/s^2] at which files are compared, not parallel to any axis of a frame."""

MAX_TIPS = 4
"""Largest number of branches at whose ends Jacobians are compared."""

MAX_LIMIT_DISTANCE = 100.0
"""Distance from zero [rad or m] beyond which limits are ignored and states are drawn near zero, because
rounding of the coordinate would dominate the errors there."""


@dataclass(frozen=True, eq=False)
class States:
    """n states: q (n, nq), v, a, tau (n, nv)."""

    q: Floats
    v: Floats
    a: Floats
    tau: Floats

    def __len__(self) -> int:
        return len(self.q)


@dataclass(frozen=True, eq=False)
class ReferenceValues:
    """Values of all compared quantities for `model` at `states`.

    `poses` (n, n_links, 4, 4) of the links in the world; by link `jacobians` (n, 6, nv) of its frame, linear
    rows first, in axes of the world; `mass_matrix` (n, nv, nv); `torque` (n, nv) for the accelerations of
    `states`, and `bias` (n, nv) the part of it without acceleration. `solvable` says whether forward dynamics
    has a solution. `kinematics_only` says that the file has no inertial data (DX118), so that nothing else
    can be compared.
    """

    model: Model
    states: States
    poses: Floats
    jacobians: Mapping[str, Floats]
    mass_matrix: Floats
    torque: Floats
    bias: Floats
    solvable: bool
    kinematics_only: bool = False

    def first(self, count: int) -> ReferenceValues:
        """Keep the first `count` states."""
        states = self.states
        return replace(
            self,
            states=States(states.q[:count], states.v[:count], states.a[:count], states.tau[:count]),
            poses=self.poses[:count],
            jacobians={link: J[:count] for link, J in self.jacobians.items()},
            mass_matrix=self.mass_matrix[:count],
            torque=self.torque[:count],
            bias=self.bias[:count],
        )

    def required_torque(self, a: Floats) -> Floats:
        """Compute tau (n, nv) that accelerations a (n, nv) require at the states."""
        return np.asarray(np.einsum("nij,nj->ni", self.mass_matrix, a) + self.bias)


def model_without_mimics(source: XmlSource, base: Base) -> Model:
    """Read the robot of a document in the coordinates of all its moving joints, in tilted gravity."""
    joints = source.root.all("joint")
    followers = [mimic for joint in joints for mimic in joint.all("mimic")]
    free = source.apply(*(source.removal(mimic) for mimic in followers)) if followers else source
    return read_model(free.text, source.source, base=base, gravity=TILTED_GRAVITY)


def draw_states(model: Model, count: int, seed: int) -> States:
    """Draw random states: positions in the middle four fifths of the range of each joint, which extends to
    its limits, or to pi [rad] or 1 [m] from zero (or from the limit nearest to zero) if these are closer;
    velocities and accelerations up to 2.

    Engines that compute a step apply a force at a limit, so no limit may be reached within a step. For a
    range of zero width, positions are drawn as without limits.
    """
    rng = np.random.default_rng(seed)
    base = 7 if model.floating else 0
    q = model.random(rng, count)
    turning = np.array([joint.type != "prismatic" for joint in model.coordinate_joints], dtype=bool)
    reach = np.where(turning, np.pi, 1.0)
    lower, upper = model.lower[base:], model.upper[base:]
    # If zero is outside the limits, positions near the closest limit are drawn.
    near = np.clip(0.0, lower, np.maximum(upper, lower))
    near = np.where((np.abs(near) < reach) | (np.abs(near) > MAX_LIMIT_DISTANCE), 0.0, near)
    low, high = np.maximum(lower, near - reach), np.minimum(upper, near + reach)
    room = low < high
    low, high = np.where(room, low, -reach), np.where(room, high, reach)
    q[:, base:] = low + (high - low) * rng.uniform(0.1, 0.9, (count, model.nq - base))
    v, a, tau = rng.uniform(-2.0, 2.0, (3, count, model.nv))
    return States(q, v, a, tau)


def with_positions(model: Model, states: States, positions: Mapping[str, float]) -> States:
    """Add a state: the first one, with these joints at these positions."""
    q = states.q[0].copy()
    base = 7 if model.floating else 0
    for k, name in enumerate(model.joint_names):
        q[base + k] = positions.get(name, q[base + k])
    added = (q, states.v[0], states.a[0], states.tau[0])
    columns = (states.q, states.v, states.a, states.tau)
    return States(*(np.vstack([column, row]) for column, row in zip(columns, added, strict=True)))


def reference_values(model: Model, states: States) -> ReferenceValues:
    """Compute the reference values; forward dynamics gets the `torque` of the previous state."""
    # A file without any mass gives NaN here, which is compared, so NumPy's warning is silenced.
    with np.errstate(all="ignore"), ReferenceBackend(model) as reference:
        # Frames of links come first; engines do not have the frames that dynx adds.
        poses = reference.forward_kinematics(states.q)[:, : len(model.links)]
        bias = reference.bias_torque(states.q, states.v)
        torque = reference.inverse_dynamics(states.q, states.v, states.a)
        mass_matrix = reference.mass_matrix(states.q)
        return ReferenceValues(
            model=model,
            # The torques of other states have the right magnitude for the robot but do not compensate its
            # weight.
            states=States(states.q, states.v, states.a, np.roll(torque, 1, axis=0)),
            poses=poses,
            jacobians={tip: reference.jacobian(states.q, tip) for tip in _tips(model)},
            mass_matrix=mass_matrix,
            torque=torque,
            bias=bias,
            solvable=bool(model.nv) and not singular_coordinates(model) and _is_regular(mass_matrix),
        )


def referee_error(reference: ReferenceValues) -> float:
    """Return the relative error of the reference values themselves at the first state, against 50 digits."""
    if not reference.model.nv:
        return 0.0
    states, referee = reference.states, Referee(reference.model)
    exact_torque = referee.inverse_dynamics(states.q[:1], states.v[:1], states.a[:1])
    exact_mass = referee.mass_matrix(states.q[:1])
    pairs = ((exact_torque, reference.torque), (exact_mass, reference.mass_matrix))
    return max(_ratio((exact - found[:1]).astype(np.float64), found) for exact, found in pairs)


def _is_regular(mass_matrix: Floats) -> bool:
    """Check that the mass matrices (n, nv, nv) stay regular under errors within the tolerance of engines.

    Scaled to a unit diagonal, each must have its eigenvalues further from zero than `BAR`: nearer ones leave
    no digit of the acceleration, as on a floating base of 1e-15 kg that carries an arm.
    """
    diagonal = np.abs(np.einsum("nii->ni", mass_matrix))
    if not np.isfinite(mass_matrix).all() or not diagonal.all():
        return False
    scale = 1.0 / np.sqrt(diagonal)
    values = np.linalg.eigvalsh(mass_matrix * scale[:, :, None] * scale[:, None, :])
    return bool(np.all(np.abs(values) > BAR))


def _ratio(gap: Floats, values: Floats) -> float:
    magnitude = float(np.max(np.abs(values), initial=0.0))
    return float(np.max(np.abs(gap), initial=0.0)) / (magnitude or 1.0)


def _tips(model: Model) -> tuple[str, ...]:
    """Choose links without children that some joint moves, spread over the tree."""
    if not model.nv:
        return ()
    parents = {joint.parent for joint in model.joints}
    moved = {frame.name for frame in model.mechanism.frames if frame.body >= 0}
    ends = [link.name for link in model.links if link.name not in parents and link.name in moved]
    ends = ends or [model.links[-1].name]
    return tuple(ends[:: max(1, len(ends) // MAX_TIPS)][:MAX_TIPS])
