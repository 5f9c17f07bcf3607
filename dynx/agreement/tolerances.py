"""Every tolerance of the project, and why it is what it is.

Errors are judged relative to the natural size of a quantity (`dynx.agreement.magnitudes`), so a
tolerance is a pure number. Each is derived from the unit roundoff and from how often rounding errors
are handed on; the bars are what dynx promises and cap whatever the derivation allows.
"""

from __future__ import annotations

from dynx.agreement.magnitudes import EPS

BAR = 1e-12
"""Promise for poses, Jacobians, inverse dynamics, mass matrix and gravity, in the max norm; and for
forward dynamics as a backward error: the torque that the acceleration found really takes, less the
torque asked for. A forward error is no measure of it, since an ill-conditioned mass matrix turns one
rounding error into any acceleration error with nobody at fault."""

COMPONENT_BAR = 1e-10
"""Promise for each torque by itself. A finger at the end of a long arm inherits the rounding errors
of the arm's acceleration times its own size, so relative to its own torque it is worse off than the
largest torque by the ratio of its distance from its axis to its radius of gyration."""

ROUNDINGS = 32
"""Rounding errors, in units of the roundoff, that one joint adds on the way out and back: a rotation
(three products and two sums an entry) applied to motions outward and to wrenches inward, the
rounding of sine and cosine, and the lumping of welded links, each once in either engine."""

FIXED_JOINTS = 4
"""Joints' worth of rounding that even a robot without joints has: base pose, frame offset, inertia."""

STEP = 1.0 / 16.0
"""Step of a numerical derivative times the highest angular frequency in the function (see
`dynx.agreement.differentiation`): it balances truncation against rounding."""

ORDER = 8
"""Order of the central difference."""

TRUNCATION = 1.0 / 630.0
"""The difference of order 8 misses h^8 f^(9) / 630 (Fornberg 1988, table 1)."""

CANCELLATION = 2.1
"""Sum of the absolute weights of that difference: how much of a rounding error it passes on, over h."""

REACHED = 1e-6
"""A target counts as reached within this many metres and radians: what `dynx.ik` asks by default."""


def rounding(depth: int) -> float:
    """Error of a quantity that is handed through a chain of `depth` joints."""
    return min(BAR, ROUNDINGS * EPS * (depth + FIXED_JOINTS))


def component(depth: int) -> float:
    """Error of a single torque relative to its own natural size."""
    return min(COMPONENT_BAR, rounding(depth) * 1e3)


def solving() -> float:
    """Backward error of solving for accelerations.

    Solving with the mass matrix would cost order nv roundoffs (Higham 2002, theorem 10.4), but the
    articulated-body algorithm is not backward stable in the ratio of the masses: under a root of
    1e-4 kg it loses three digits with nobody at fault. So this is the bar itself.
    """
    return BAR


def eigenvalue(depth: int, nv: int) -> float:
    """How far below zero rounding can push an eigenvalue of the mass matrix at unit diagonal: nv
    times the error of an entry (Weyl)."""
    return nv * rounding(depth)


def derivative(depth: int) -> float:
    """Error of a numerical derivative relative to size times frequency: Bernstein's bound on the ninth
    derivative of a band-limited function gives the truncation, `CANCELLATION` the rounding."""
    return STEP**ORDER * TRUNCATION + CANCELLATION * ROUNDINGS * EPS * (depth + FIXED_JOINTS) / STEP


def singular(nv: int) -> float:
    """Eigenvalue of the mass matrix at unit diagonal below which it is singular to double precision."""
    return ROUNDINGS * EPS * nv


def reached(depth: int, length: float) -> float:
    """Distance [m, rad] from the target at which another engine's poses may put a solution."""
    return REACHED + rounding(depth) * max(1.0, length)
