"""Settings of MuJoCo's solver and contacts, and contacts with the mean coefficients of two materials.

A contact of MuJoCo is a damped spring between accelerations: in it the bodies approach each other with a = -b
v - k r, whatever their masses (r is the distance, negative where they penetrate). dynx gives k and b
directly, for a natural frequency 1 / `time_constant` and a damping ratio that follows from the restitution.

Every pair of geoms that may touch is an explicit pair with coefficients of its own. It takes some nanoseconds
in every step, so in scenes of very many geoms moving bodies touch one another by MuJoCo's own rule: it takes
the coefficients of the geom with the higher priority (`dynx.steppers.mean_coefficients`).

Only explicit pairs have a damping of slip apart from that of the normal direction. MuJoCo's friction pushes
bodies apart in proportion to the damping times the sliding speed, so that bodies hop where it is as large as
that of a contact that does not rebound; geoms without an explicit pair are damped critically at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.steppers.contact_springs import damping_ratio, restitution_of
from dynx.steppers.layout import Layout
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.materials import STRICT_MATERIALS, EffectiveCoefficient, coefficients
from dynx.steppers.mean_coefficients import contact_directions, contact_priorities
from dynx.steppers.settings import Setting

SETTINGS: Mapping[str, Setting] = {
    "integrator": Setting(
        "euler",
        "MuJoCo's integrator: semi-implicit Euler, or one that treats velocity-dependent forces implicitly",
        choices=("euler", "implicitfast", "implicit"),
    ),
    "solver": Setting("newton", "constraint solver", choices=("newton", "cg", "pgs")),
    "iterations": Setting(100, "largest number of iterations of the solver", 1),
    "tolerance": Setting(1e-10, "tolerance at which the solver stops", 0.0),
    "cone": Setting(
        "elliptic",
        "shape of the friction cone: 'elliptic' or 'pyramidal'",
        choices=("elliptic", "pyramidal"),
    ),
    "impratio": Setting(
        100.0,
        "MuJoCo's impratio: hardness of friction divided by hardness of the normal force; with a larger "
        "value sticking contacts creep less",
        1e-6,
    ),
    "noslip_iterations": Setting(0, "iterations of the solver that removes slip", 0),
    "ccd_iterations": Setting(50, "largest number of iterations of convex collision detection", 1),
    "time_constant": Setting(
        0.005,
        "time constant of contacts and joint limits [s], at least two steps; a smaller value is stiffer",
        1e-6,
    ),
    "slip_time_constant": Setting(
        0.01,
        "time constant at which friction stops a slow slip [s], at least one step; with a small value, "
        "fast sliding bodies may hop",
        1e-6,
    ),
    "impedance": Setting(
        (0.9, 0.95, 0.001, 0.5, 2.0),
        "MuJoCo's solimp of contacts and joint limits: d_0, d_width, width [m or rad], midpoint, power",
    ),
    "margin": Setting(0.0, "distance [m] below which a contact is active", 0.0),
    "constraint_time_constant": Setting(
        0.005,
        "time constant of welds, point-to-point constraints, mimic joints and joint friction [s], "
        "at least two steps",
        1e-6,
    ),
    "constraint_impedance": Setting(
        (0.95, 0.99, 0.001, 0.5, 2.0),
        "MuJoCo's solimp of welds and point-to-point constraints",
    ),
    "joint_friction_impedance": Setting(
        0.999,
        "MuJoCo's impedance of joint friction; near 1 a sticking joint creeps least",
        0.0001,
        0.9999,
    ),
    "strict_materials": STRICT_MATERIALS,
}
"""Settings by name; the defaults are dynx's canonical ones."""

MIMIC_IMPEDANCE = (0.9999, 0.9999)
"""MuJoCo's solimp of mimic joints, its largest: what impedance is missing from 1 is the share of a force that
the coupling leaves on one joint."""

_MJCF_NAMES = {"euler": "Euler", "newton": "Newton", "cg": "CG", "pgs": "PGS"}
"""Settings whose names in MJCF are not those in lower case."""

_OPTIONS = (
    *("integrator", "solver", "cone", "iterations", "tolerance"),
    *("impratio", "noslip_iterations", "ccd_iterations"),
)
"""Settings that are options of an MJCF document."""


def option_attributes(settings: Mapping[str, Any], gravity: Floats, dt: float) -> dict[str, Any]:
    """Return the attributes of MJCF's options: gravity, the step and the settings of the solver."""
    chosen = {name: _MJCF_NAMES.get(settings[name], settings[name]) for name in _OPTIONS}
    return {"timestep": dt, "gravity": gravity, **chosen}


LEAST_STEPS = {"time_constant": 2.0, "slip_time_constant": 1.0, "constraint_time_constant": 2.0}
"""Least number of steps of each time constant: MuJoCo's springs diverge with shorter ones."""


def time_constant(settings: Mapping[str, Any], name: str, dt: float) -> float:
    """Return a time constant in effect [s]."""
    return max(float(settings[name]), LEAST_STEPS[name] * dt)


def natural_frequency(settings: Mapping[str, Any], dt: float) -> float:
    """Return the natural frequency [rad/s] of contacts and joint limits."""
    return 1.0 / time_constant(settings, "time_constant", dt)


def contact_reference(
    settings: Mapping[str, Any], restitution: float, dt: float, *, slips: bool = False
) -> tuple[float, float]:
    """Return MuJoCo's solref (-k, -b) of a contact with this restitution, or with the nearest possible.

    Where it `slips` by the same reference, the contact is damped critically at most.
    """
    frequency = natural_frequency(settings, dt)
    return -(frequency**2), -2.0 * _ratio(settings, restitution, dt, slips) * frequency


def contact_restitution(
    settings: Mapping[str, Any], restitution: float, dt: float, *, slips: bool = False
) -> float:
    """Return the restitution of the contact that `contact_reference` gives for the wanted one."""
    return restitution_of(_ratio(settings, restitution, dt, slips), natural_frequency(settings, dt) * dt)


def _ratio(settings: Mapping[str, Any], restitution: float, dt: float, slips: bool) -> float:
    ratio = damping_ratio(restitution, natural_frequency(settings, dt) * dt)
    return min(ratio, 1.0) if slips else ratio


def slip_reference(settings: Mapping[str, Any], dt: float) -> tuple[float, float]:
    """Return MuJoCo's solreffriction (-k, -b) of contacts; slip has no spring, and MuJoCo ignores k."""
    return -1.0, -1.0 / time_constant(settings, "slip_time_constant", dt)


def limit_reference(settings: Mapping[str, Any], dt: float) -> tuple[float, float]:
    """Return MuJoCo's solref (-k, -b) of joint limits, which are damped critically."""
    frequency = natural_frequency(settings, dt)
    return -(frequency**2), -2.0 * frequency


def constraint_reference(settings: Mapping[str, Any], dt: float) -> tuple[float, float]:
    """Return MuJoCo's solref of welds, point-to-point constraints, mimic joints and joint friction."""
    return time_constant(settings, "constraint_time_constant", dt), 1.0


MAX_PAIRS = 2000
"""Largest number of explicit pairs of geoms, beside those without which a contact had other coefficients."""

TOLERANCE = 0.02
"""Error of the height of a rebound, relative to that of the fall, that counts as none."""

REASON = "in steps this long a damped spring rebounds at least so much; in shorter ones it can rebound less"


class ContactMaterials:
    """Options of the geoms of every collider, and of explicit pairs."""

    def __init__(self, layout: Layout, settings: Mapping[str, Any], dt: float) -> None:
        self._restitution = coefficients(layout, "restitution")
        self._settings, self._dt = settings, dt
        materials, numbers = material_numbers(each.material for each in layout.colliders)
        means = geometric_means(materials)
        rows, inverse = np.unique(means.reshape(-1, 4), axis=0, return_inverse=True)
        combination = inverse.reshape(means.shape[:2])
        found = contact_priorities(numbers, combination, layout.collides)
        self._explicit = _explicit_pairs(layout)
        for i, j in found.pairs:
            self._explicit[i, j] = self._explicit[j, i] = True
        self.complete = bool((self._explicit == layout.collides).all())
        """True if every pair of colliders that may touch is an explicit one."""
        self._geoms = [self._geom_options(row) for row in rows.tolist()]
        self._combination, self._priority = found.combination, found.priority
        self.common = {"priority": 0, **self._spring_options(0.0, slips=True)}
        """Options that most geoms have."""
        self.common_of_pairs = self._spring_options(0.0, slips=False)
        """Options that most explicit pairs have."""
        of_pair = [self._pair_options(row) for row in rows.tolist()]
        self.pairs = [
            (i, j, of_pair[combination[numbers[i], numbers[j]]])
            for i, j in np.argwhere(np.triu(self._explicit)).tolist()
        ]
        """Numbers of two colliders, and the options of their pairs of geoms."""

    def geom(self, collider: int) -> dict[str, Any]:
        """Return the options of the geoms of a collider."""
        return {**self._geoms[self._combination[collider]], "priority": int(self._priority[collider])}

    def _geom_options(self, row: list[float]) -> dict[str, Any]:
        *friction, restitution = row
        spring = self._spring_options(restitution, slips=True)
        return {"condim": contact_directions(*friction), "friction": friction, **spring}

    def _pair_options(self, row: list[float]) -> dict[str, Any]:
        sliding, torsional, rolling, restitution = row
        return {
            "condim": contact_directions(sliding, torsional, rolling),
            "friction": [sliding, sliding, torsional, rolling, rolling],
            **self._spring_options(restitution, slips=False),
        }

    def _spring_options(self, restitution: float, *, slips: bool) -> dict[str, Any]:
        """Return the options of the spring of a contact; one that does not slip by it has another damping of
        slip."""
        settings, dt = self._settings, self._dt
        spring = {
            "solref": contact_reference(settings, restitution, dt, slips=slips),
            "solimp": settings["impedance"],
            "margin": settings["margin"],
        }
        return spring if slips else {**spring, "solreffriction": slip_reference(settings, dt)}

    def effective(self) -> Mapping[str, EffectiveCoefficient]:
        """Return the coefficients in effect."""

        def restitution(i: int, j: NDArray[np.intp]) -> Floats:
            found = np.sqrt(self._restitution[i] * self._restitution[j])
            slips = ~self._explicit[i, j]
            for wanted in np.unique(found).tolist():
                for alone in (True, False):
                    actual = contact_restitution(self._settings, wanted, self._dt, slips=alone)
                    if abs(actual**2 - wanted**2) > TOLERANCE:
                        found[(found == wanted) & (slips == alone)] = actual
            return np.asarray(found)

        return {"restitution": EffectiveCoefficient(restitution, REASON)}


def _explicit_pairs(layout: Layout) -> NDArray[np.bool_]:
    """Return which colliders (n, n) are explicit pairs: all that may touch, or those of which one is fixed,
    or none, whichever first are at most `MAX_PAIRS` pairs of geoms."""
    shapes = np.array([len(collider.shapes) for collider in layout.colliders], dtype=np.intp)
    fixed = np.array([layout.is_fixed(collider.owner) for collider in layout.colliders], dtype=bool)
    for touch in (layout.collides, layout.collides & (fixed[:, None] | fixed)):
        if (
            sum(int(shapes[row].sum()) * int(n) for row, n in zip(touch, shapes, strict=True))
            <= 2 * MAX_PAIRS
        ):
            return np.asarray(touch.copy())
    return np.zeros_like(layout.collides)
