"""Time-optimal motion between two states under limits of velocity, acceleration and jerk, by Ruckig.

Each joint follows its own jerk-limited profile, synchronised to the slowest one (Berscheid and Kröger,
Jerk-limited real-time trajectory generation with arbitrary target states, RSS 2021). Ruckig runs once; its
result is stored as polynomials, so that evaluating the trajectory does not need Ruckig.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, TrajectoryError, importing, nonblank_lines
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import MAX_DURATION, MIN_DURATION, Trajectory
from dynx.trajectory.curve import PiecewisePolynomial
from dynx.trajectory.displacement import Ends, checked_ends
from dynx.trajectory.motion_limits import checked_limit, require_positive_finite, velocity_limits

Phase = tuple[float, tuple[float, float, float, float]]
"""Duration [s], and position, velocity, acceleration and jerk at the start of the phase."""


@checks_types
def time_optimal(
    q0: ArrayLike,
    q1: ArrayLike,
    *,
    acceleration: ArrayLike,
    jerk: ArrayLike,
    velocity: ArrayLike | None = None,
    v0: ArrayLike | None = None,
    v1: ArrayLike | None = None,
    a0: ArrayLike | None = None,
    a1: ArrayLike | None = None,
    model: Model | None = None,
) -> Trajectory:
    """Return the fastest motion from the state (`q0`, `v0`, `a0`) to (`q1`, `v1`, `a1`) within the limits.

    `velocity`, `acceleration` and `jerk` are limits, one number or (nv,), positive and finite; the default of
    `velocity` is the limit of the `model`. v and a default to 0. The joints arrive together, but do not stay
    on a straight line as with `s_curve`; position limits are not considered between the ends
    (`dynx.trajectory.check` checks them). Only for a fixed base.

    Raises NotInstalledError without the extra ``trajectory``, TrajectoryError if no such motion is found (for
    example if an end exceeds the limits), ArgumentError for invalid arguments.
    """
    ends = checked_ends(q0, q1, model)
    if model is not None and model.floating:
        raise ArgumentError(f"{model.name} has a floating base; use s_curve, which follows one screw")
    if model is not None:
        refuse_ball_joints(model, "time_optimal, unlike s_curve,")
    limits = {
        "velocity": velocity_limits(velocity, ends),
        "acceleration": checked_limit("acceleration", acceleration, ends.nv),
        "jerk": checked_limit("jerk", jerk, ends.nv),
    }
    for name, bound in limits.items():
        require_positive_finite(name, bound, ends)
    begin = ends.velocity("v0", v0), ends.velocity("a0", a0)
    finish = ends.velocity("v1", v1), ends.velocity("a1", a1)
    _require_ends_within_limits(
        ends, limits, {"v0": begin[0], "a0": begin[1], "v1": finish[0], "a1": finish[1]}
    )
    found = _run_ruckig(ends, limits, begin, finish)
    duration = float(found.duration)
    if duration == 0.0:
        raise ArgumentError("q0 and q1 are the same, at the same velocity; no motion is needed")
    if not MIN_DURATION <= duration <= MAX_DURATION:
        raise TrajectoryError(
            f"the motion takes {duration:g} s; wanted between {MIN_DURATION:g} and {MAX_DURATION:g} s"
        )
    phases = [list(_phases(profile, duration)) for profile in found.profiles[0]]
    return ends.trajectory(duration, _common_breaks(phases, duration), begin, finish)


def _run_ruckig(
    ends: Ends, limits: dict[str, Floats], begin: tuple[Floats, Floats], finish: tuple[Floats, Floats]
) -> Any:
    """Return Ruckig's trajectory, relative to q0."""
    with importing("time_optimal needs Ruckig: pip install 'dynx[trajectory]' ({error})"):
        import ruckig
    parameters = ruckig.InputParameter(ends.nv)
    parameters.current_position, parameters.target_position = [0.0] * ends.nv, ends.displacement.tolist()
    parameters.current_velocity, parameters.current_acceleration = (x.tolist() for x in begin)
    parameters.target_velocity, parameters.target_acceleration = (x.tolist() for x in finish)
    parameters.max_velocity = limits["velocity"].tolist()
    parameters.max_acceleration = limits["acceleration"].tolist()
    parameters.max_jerk = limits["jerk"].tolist()
    trajectory = ruckig.Trajectory(ends.nv)
    try:
        result = ruckig.Ruckig(ends.nv).calculate(parameters, trajectory)
    except (ruckig.RuckigError, ValueError) as error:
        # Ruckig raises ValueError if its result code has no name.
        cause = (nonblank_lines(error) or [type(error).__name__])[0]
        raise TrajectoryError(f"Ruckig finds no motion between these states: {cause}") from error
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise TrajectoryError(f"Ruckig finds no motion between these states: {result}")
    return trajectory


def _phases(profile: Any, duration: float) -> Iterator[Phase]:
    """Yield the phases of one joint: braking into the limits, the seven of the profile, and final rest."""
    passed = 0.0
    for part in (profile.brake, profile):
        states = zip(part.t, part.p, part.v, part.a, part.j, strict=False)
        for span, *state in states:
            if span > 0.0:
                p, v, a, j = state
                yield span, (p, v, a, j)
                passed += span
    if passed < duration:
        yield duration - passed, (profile.pf, profile.vf, 0.0, 0.0)


def _common_breaks(phases: list[list[Phase]], duration: float) -> PiecewisePolynomial:
    """Return the polynomials of all joints over common pieces, divided at the breaks of every joint."""
    own = [np.cumsum([0.0] + [span for span, _ in joint]) for joint in phases]
    breaks = np.unique(np.concatenate([np.minimum(times[:-1], duration) for times in own]))
    breaks = np.append(breaks[breaks < duration], duration)
    columns = []
    for joint, times in zip(phases, own, strict=True):
        number = np.minimum(np.searchsorted(times, breaks[:-1], side="right") - 1, len(joint) - 1)
        p, v, a, j = np.array([state for _, state in joint])[number].T
        s = breaks[:-1] - times[number]
        columns.append(
            [
                p + s * (v + s * (a / 2.0 + s * (j / 6.0))),
                v + s * (a + s * (j / 2.0)),
                (a + s * j) / 2.0,
                j / 6.0,
            ]
        )
    return PiecewisePolynomial(breaks, np.transpose(np.array(columns), (2, 1, 0)))


def _require_ends_within_limits(ends: Ends, limits: dict[str, Floats], states: dict[str, Floats]) -> None:
    for name, value in states.items():
        quantity = "velocity" if name.startswith("v") else "acceleration"
        over = np.flatnonzero(np.abs(value) > limits[quantity])
        if over.size:
            k = int(over[0])
            raise TrajectoryError(
                f"{name} of {ends.name(k)} is {value[k]:g}, beyond its limit of {quantity}, "
                f"{limits[quantity][k]:g}"
            )
    V, J = limits["velocity"], limits["jerk"]
    for n, after in ((0, 1.0), (1, -1.0)):
        # Velocity when the acceleration is 0 for the first time after the start, or the last before the end.
        v, a = states[f"v{n}"], states[f"a{n}"]
        reached = v + after * 0.5 * a * np.abs(a) / J
        over = np.flatnonzero(np.abs(reached) > V)
        if over.size:
            k = int(over[0])
            raise TrajectoryError(
                f"v{n} = {v[k]:g} with a{n} = {a[k]:g} of {ends.name(k)} takes a velocity of {reached[k]:g} "
                f"{'afterwards' if n == 0 else 'before'}, beyond its limit, {V[k]:g}"
            )
