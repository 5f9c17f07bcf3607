"""Every tolerance of the project, and its derivation.

Errors are relative to the natural magnitude of a quantity (`dynx.agreement.magnitudes`), so a
tolerance is a pure number. Each is derived from the unit roundoff and the number of joints through which
rounding errors accumulate, and is at most the error that dynx promises.
"""

from __future__ import annotations

from dynx.agreement.magnitudes import EPS

BAR = 1e-12
"""Promised bound on the error of poses, Jacobians, inverse dynamics, mass matrix and gravity, in the max
norm; and on the backward error of forward dynamics: the torque that the acceleration requires minus the
given torque. Its forward error has no such bound: with an ill-conditioned mass matrix one rounding error of
the input changes the acceleration by any amount."""

MAX_COMPONENT_ERROR = 1e-10
"""Promised bound on the error of each torque over its own magnitude. It is much larger than the other bound,
because the small torque of a finger at the end of a long arm contains rounding errors of the arm's large
accelerations: its relative error grows by the ratio of the finger's distance from the arm's axis to its
radius of gyration."""

ROUNDINGS = 32
"""Rounding errors that one joint adds, in units of the roundoff. They come from a rotation (three products
and two sums per entry) applied to twists outward and to wrenches inward, from sine and cosine, and from the
merging of fixed joints, in each of the two compared engines."""

FIXED_JOINTS = 4
"""Number of joints whose rounding errors equal those of base pose, frame offset and inertia."""

STEP = 1.0 / 16.0
"""Step of a numerical derivative times the highest angular frequency in the function (see
`dynx.agreement.identities`): it balances truncation against rounding."""

ORDER = 8
"""Order of the central difference."""

TRUNCATION = 1.0 / 630.0
"""Truncation error of the central difference of order 8, in units of h^8 f^(9) (Fornberg 1988, table 1)."""

CANCELLATION = 2.1
"""Sum of the absolute weights of that difference: it multiplies rounding errors, and h divides them."""

TARGET_TOLERANCE = 1e-6
"""Distance [m, rad] within which a target is reached, the default of `dynx.ik`."""


def rounding(depth: int) -> float:
    """Return the bound on the error of a quantity that is computed along a chain of `depth` joints."""
    return min(BAR, ROUNDINGS * EPS * (depth + FIXED_JOINTS))


def component(depth: int) -> float:
    """Return the bound on the error of a single torque over its own magnitude."""
    return min(MAX_COMPONENT_ERROR, rounding(depth) * 1e3)


def solving() -> float:
    """Return the bound on the backward error of solving for accelerations.

    Solving with the mass matrix would cost order nv roundoffs (Higham 2002, theorem 10.4), but the
    articulated-body algorithm is not backward stable in the ratio of the masses: with a root link of 1e-4 kg
    it loses three digits. The tolerance is therefore the promised bound.
    """
    return BAR


def eigenvalue(depth: int, nv: int) -> float:
    """Return the bound on the rounding error of an eigenvalue of the mass matrix at unit diagonal: nv times
    the error of an entry (Weyl)."""
    return nv * rounding(depth)


def derivative(depth: int) -> float:
    """Return the bound on the error of a numerical derivative over magnitude times frequency: Bernstein's
    bound on the ninth derivative of a band-limited function gives truncation, `CANCELLATION` rounding."""
    return STEP**ORDER * TRUNCATION + CANCELLATION * ROUNDINGS * EPS * (depth + FIXED_JOINTS) / STEP


def singular(nv: int) -> float:
    """Return the eigenvalue of the mass matrix at unit diagonal below which it is numerically singular."""
    return ROUNDINGS * EPS * nv


def target_distance(depth: int, length: float) -> float:
    """Return the bound on the distance [m, rad] of a solution from its target by another engine's poses."""
    return TARGET_TOLERANCE + rounding(depth) * max(1.0, length)
