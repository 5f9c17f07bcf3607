"""The right answers for a file: what dynx reads in it, evaluated by the algorithms of `dynx.rbd`.

Coordinates are those of all moving joints, mimic joints included, because that is what engines load:
the ``<mimic>`` tags are set aside. Gravity is tilted, so that an answer in the wrong frame shows. The
backend `reference`, which evaluates here, is held to a 50-digit referee by ``dynx agree``.
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
from dynx.model.model import Base
from dynx.model.xml.source import XmlSource
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

TILTED: Vector = (0.3, -0.7, -9.81)
"""Gravity [m/s^2] at which files are compared: along no axis of any frame."""

MOST_TIPS = 4
"""Jacobians are compared at the ends of up to so many branches."""

FARTHEST = 100.0
"""Limits beyond which a joint [rad or m] is compared near to zero all the same: so far from there the
rounding of its coordinate would be what is compared."""


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
class Truth:
    """The answers for `model` at `states`.

    `poses` (n, n_links, 4, 4) of the links in the world; by link `jacobians` (n, 6, nv) of its frame, linear
    rows first, in axes of the world; `mass_matrix` (n, nv, nv); `torque` (n, nv) for the accelerations of
    `states`, and `bias` (n, nv) the part of it without acceleration. `solvable` says whether forward dynamics
    has an answer at all.
    """

    model: Model
    states: States
    poses: Floats
    jacobians: Mapping[str, Floats]
    mass_matrix: Floats
    torque: Floats
    bias: Floats
    solvable: bool

    def take(self, count: int) -> Truth:
        """The same at the first `count` states alone."""
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

    def torque_taken(self, a: Floats) -> Floats:
        """tau (n, nv) that accelerations (n, nv) really take at the states."""
        return np.asarray(np.einsum("nij,nj->ni", self.mass_matrix, a) + self.bias)


def free_model(source: XmlSource, base: Base) -> Model:
    """The robot of a document in the coordinates of all its moving joints, in tilted gravity."""
    joints = source.root.all("joint")
    followers = [mimic for joint in joints for mimic in joint.all("mimic")]
    free = source.edited(*(source.removing(mimic) for mimic in followers)) if followers else source
    return read_model(free.text, source.source, base=base, gravity=TILTED)


def draw_states(model: Model, count: int, seed: int) -> States:
    """Random states: the middle four fifths of what limits allow, elsewhere any angle and lengths up to
    1 m, or as much from the limit nearest to zero; velocities and accelerations up to 2.

    Engines that step meet a limit with a force, and no limit is to be met within a step. A range
    without width leaves no middle, so there a joint may be anywhere.
    """
    rng = np.random.default_rng(seed)
    base = 7 if model.floating else 0
    q = model.random(rng, count)
    turning = np.array([joint.type != "prismatic" for joint in model.coordinate_joints], dtype=bool)
    reach = np.where(turning, np.pi, 1.0)
    lower, upper = model.lower[base:], model.upper[base:]
    # What is near to zero may be beyond the limits: then it is what is near to the limits.
    near = np.clip(0.0, lower, np.maximum(upper, lower))
    near = np.where((np.abs(near) < reach) | (np.abs(near) > FARTHEST), 0.0, near)
    low, high = np.maximum(lower, near - reach), np.minimum(upper, near + reach)
    room = low < high
    low, high = np.where(room, low, -reach), np.where(room, high, reach)
    q[:, base:] = low + (high - low) * rng.uniform(0.1, 0.9, (count, model.nq - base))
    v, a, tau = rng.uniform(-2.0, 2.0, (3, count, model.nv))
    return States(q, v, a, tau)


def find_truth(model: Model, states: States) -> Truth:
    """Evaluate the right answers; forward dynamics is asked with torques of the size of `torque`."""
    # What a file without a single mass makes of these is compared, not announced by NumPy.
    with np.errstate(all="ignore"), ReferenceBackend(model) as reference:
        # Frames of links come first; those that dynx adds are no links to an engine.
        poses = reference.forward_kinematics(states.q)[:, : len(model.links)]
        bias = reference.bias_torque(states.q, states.v)
        torque = reference.inverse_dynamics(states.q, states.v, states.a)
        mass_matrix = reference.mass_matrix(states.q)
        tips = _tips(model)
        return Truth(
            model=model,
            states=States(states.q, states.v, states.a, _shuffled(torque)),
            poses=poses,
            jacobians={tip: reference.jacobian(states.q, tip) for tip in tips},
            mass_matrix=mass_matrix,
            torque=torque,
            bias=bias,
            solvable=bool(model.nv) and not singular_coordinates(model) and _is_regular(mass_matrix),
        )


def refereed(truth: Truth) -> float:
    """Relative error of the right answers themselves at the first state, against 50 digits."""
    if not truth.model.nv:
        return 0.0
    states, referee = truth.states, Referee(truth.model)
    exact = referee.inverse_dynamics(states.q[:1], states.v[:1], states.a[:1])
    exact_M = referee.mass_matrix(states.q[:1])
    gaps = [(exact - truth.torque[:1], truth.torque), (exact_M - truth.mass_matrix[:1], truth.mass_matrix)]
    return max(_ratio(gap.astype(np.float64), right) for gap, right in gaps)


def _is_regular(mass_matrix: Floats) -> bool:
    """Whether the mass matrices (n, nv, nv) stay regular under the errors that engines are allowed.

    Scaled to a unit diagonal, each has its eigenvalues further from zero than `BAR`: nearer ones leave
    no digit of the acceleration, as on a floating base of 1e-15 kg that carries an arm.
    """
    diagonal = np.abs(np.einsum("nii->ni", mass_matrix))
    if not np.isfinite(mass_matrix).all() or not diagonal.all():
        return False
    scale = 1.0 / np.sqrt(diagonal)
    values = np.linalg.eigvalsh(mass_matrix * scale[:, :, None] * scale[:, None, :])
    return bool(np.all(np.abs(values) > BAR))


def _ratio(gap: Floats, right: Floats) -> float:
    size = float(np.max(np.abs(right), initial=0.0))
    return float(np.max(np.abs(gap), initial=0.0)) / (size or 1.0)


def _shuffled(torque: Floats) -> Floats:
    """The torques of other states: of the robot's own size, but not balanced."""
    return np.roll(torque, 1, axis=0)


def _tips(model: Model) -> tuple[str, ...]:
    """Links that carry none, moved by some joint, spread over the tree."""
    if not model.nv:
        return ()
    carrying = {joint.parent for joint in model.joints}
    moved = {frame.name for frame in model.mechanism.frames if frame.body >= 0}
    ends = [link.name for link in model.links if link.name not in carrying and link.name in moved]
    ends = ends or [model.links[-1].name]
    return tuple(ends[:: max(1, len(ends) // MOST_TIPS)][:MOST_TIPS])
