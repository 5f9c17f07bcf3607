"""The states at which backends are compared: the same for every backend, drawn from a seed.

Kinds alternate, so that few samples include each: ``within`` the limits, ``anywhere`` in (-pi, pi) (so that
joints whose limits have no width move too), ``straight`` (every joint at a multiple of 90 degrees, where arms
are singular), ``limit`` (each joint at one of its limits) and ``turns`` (angles of many full turns). Half of
the samples are within limits. The attitude of a floating base is random.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.mechanism import ROOT
from dynx.rbd.jacobians import REFERENCES
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats

Kind = Literal["within", "anywhere", "straight", "limit", "turns"]
Indices = NDArray[np.intp]

KINDS: tuple[Kind, ...] = ("within", "anywhere", "within", "straight", "within", "anywhere", "limit", "turns")

MAX_TURNS = 50
"""Largest number of full turns, in either direction, in samples of kind ``turns``."""

MAX_DIFFERENTIATED_POSITION = 2.0 * np.pi
"""Bound on the positions [rad or m] at which quantities are differentiated along a motion: the rounding of q
itself must stay below that of the quantities."""


@dataclass(frozen=True)
class FrameSamples:
    """A frame and a reference, and the numbers of the samples at which they are evaluated."""

    frame: str
    reference: str
    samples: Indices


@dataclass(frozen=True)
class Samples:
    """n states of one model: q (n, nq), v, a, tau (n, nv) and a wrench (n, 6) for one frame.

    `every_frame` has each frame in each reference at some samples; `derivatives` is for quantities that are
    slower to evaluate and has fewer references of each frame for robots with very many. All entries of one
    list have equally many samples.
    """

    model: Model
    index: Indices
    kinds: tuple[Kind, ...]
    q: Floats
    v: Floats
    a: Floats
    tau: Floats
    wrench: Floats
    wrench_frame: str
    every_frame: tuple[FrameSamples, ...]
    derivatives: tuple[FrameSamples, ...]

    def __len__(self) -> int:
        return len(self.q)

    def take(self, chosen: list[int], references: int) -> Samples:
        """Return the `chosen` samples, with `references` references of each frame, each at one sample."""
        pick = np.array(chosen, dtype=np.intp)
        entries = assign_frames(self.model.frame_names, len(pick), each=1, references=references)
        return replace(
            self,
            index=self.index[pick],
            kinds=tuple(self.kinds[k] for k in pick),
            q=self.q[pick],
            v=self.v[pick],
            a=self.a[pick],
            tau=self.tau[pick],
            wrench=self.wrench[pick],
            every_frame=entries,
            derivatives=entries,
        )

    def differentiable(self, count: int) -> list[int]:
        """Return the numbers of up to `count` samples at which quantities can be differentiated: positions
        near zero, and in motion."""
        joints = self.q[:, 7 if self.model.floating else 0 :]
        near = np.max(np.abs(joints), axis=-1, initial=0.0) <= MAX_DIFFERENTIATED_POSITION
        near &= np.any(self.v != 0.0, axis=-1) & (np.array(self.kinds) != "limit")
        return [int(k) for k in np.flatnonzero(near)[:count]]


def draw_samples(model: Model, count: int, seed: int) -> Samples:
    """Return `count` samples of `model`; equal arguments give equal samples."""
    if count < 1:
        raise ArgumentError(f"samples is {count}; wanted at least 1")
    if seed < 0:
        raise ArgumentError(f"seed is {seed}; wanted a number that is not negative")
    rng = np.random.default_rng(seed)
    kinds = tuple(KINDS[k % len(KINDS)] for k in range(count))
    q = np.stack([_configuration(model, kind, rng) for kind in kinds])
    v, a, other_a = (rng.uniform(-2.0, 2.0, (count, model.nv)) for _ in range(3))
    # One sample is at rest, where Coulomb friction and every velocity product must vanish.
    if count >= len(KINDS):
        v[KINDS.index("straight")] = 0.0
    with ReferenceBackend(model) as reference:
        tau = reference.inverse_dynamics(q, v, other_a)
    names, carried = model.frame_names, _carried_frames(model)
    n_pairs = len(names) * len(REFERENCES)
    return Samples(
        model=model,
        index=np.arange(count),
        kinds=kinds,
        q=q,
        v=v,
        a=a,
        tau=tau,
        wrench=rng.uniform(-5.0, 5.0, (count, 6)),
        wrench_frame=carried[int(rng.integers(len(carried)))],
        every_frame=assign_frames(names, count, each=_share(256, n_pairs, count), references=3),
        derivatives=assign_frames(
            names,
            count,
            each=_share(64, n_pairs, count),
            references=_share(192, len(names), len(REFERENCES)),
        ),
    )


def assign_frames(
    frames: tuple[str, ...], count: int, *, each: int, references: int
) -> tuple[FrameSamples, ...]:
    """Assign samples to frames in turn: `references` references of each frame, and `each` samples to each.

    Successive entries take successive samples, so that together they cover all samples.
    """
    names = tuple(REFERENCES)
    entries, turn = [], 0
    for number, frame in enumerate(frames):
        for k in range(references):
            chosen = (turn + np.arange(each)) % count
            entries.append(FrameSamples(frame, names[(number + k) % len(names)], chosen.astype(np.intp)))
            turn += each
    return tuple(entries)


def _carried_frames(model: Model) -> list[str]:
    """Return the frames that some coordinate moves; all of them if there are none."""
    moved = [frame.name for frame in model.mechanism.frames if frame.body != ROOT or model.floating]
    return moved or list(model.frame_names)


def _narrowed(lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the limits, narrowed where possible to positions at which quantities can be differentiated;
    files may have limits of 1e16."""
    bound = MAX_DIFFERENTIATED_POSITION
    low, high = np.maximum(lower, -bound), np.minimum(upper, bound)
    room = low <= high
    return np.where(room, low, lower), np.where(room, high, upper)


def _share(budget: int, count: int, limit: int) -> int:
    return min(max(budget // count, 1), limit)


def _configuration(model: Model, kind: Kind, rng: np.random.Generator) -> Floats:
    q = model.random(rng)
    # Attitudes of ball joints are those of `random`.
    joints = [joint for joint in model.coordinate_joints if joint.type != "ball"]
    own = np.array([model.position_index(joint.name) for joint in joints], dtype=np.intp)
    n = len(own)
    lower, upper = _narrowed(model.lower[own], model.upper[own])
    turning = np.array([joint.type != "prismatic" for joint in joints], dtype=bool)
    reach = np.where(turning, np.pi, 1.0)
    if kind == "within":
        limited = np.isfinite(lower) & np.isfinite(upper)
        drawn = rng.uniform(np.where(limited, lower, -reach), np.where(limited, upper, reach))
        q[own] = np.where(limited, drawn, q[own])
    elif kind == "anywhere":
        q[own] = rng.uniform(-reach, reach)
    elif kind == "straight":
        q[own] = np.where(turning, 0.5 * np.pi * rng.integers(-1, 3, n), 0.0)
    elif kind == "limit":
        ends = np.where(rng.integers(0, 2, n) == 0, lower, upper)
        q[own] = np.where(np.isfinite(ends), ends, q[own])
    elif kind == "turns":
        many = 2.0 * np.pi * MAX_TURNS
        q[own] = np.where(turning, rng.uniform(-many, many, n), rng.uniform(-1.0, 1.0, n))
    # Half of the quaternions have a negative scalar; those of kind ``straight`` rotate by exactly pi.
    if kind == "straight":
        for first in model.quaternions:
            q[first : first + 4] = np.eye(4)[int(rng.integers(3))]
    return q
