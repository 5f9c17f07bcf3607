"""Measured errors of the integrators of `dynx.simulate`: ``python -m benchmarks.integrators``.

- A pendulum that falls from 1 rad is at its lowest point after a quarter of its period, which is known in
  closed form at any amplitude: K(sin^2(q0 / 2)) / w0 (Landau and Lifshitz, Mechanics, section 11, problem 1).
  How late it is, in steps of several lengths, gives the order of the integrator.
- UR5 keeps its energy when nothing acts on its joints; beside it, Runge-Kutta over `pin.aba` written by hand.
- A body that nothing touches keeps its momentum. (Semi-implicit Euler keeps the linear one only.)

It ends with 1 where one of them is worse than it is said to be.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.special import ellipk

from benchmarks.closed_loops import pinocchio_model
from benchmarks.tutorial_motion import DT, Task
from dynx.backends import backend, installed_backends
from dynx.engines.pinocchio.library import pin
from dynx.model.loading import load
from dynx.sim import simulate
from dynx.spatial.scalar import Floats

START = 1.0
"""Angle from which the pendulum falls [rad]."""
WIDE_OPEN = 0.1
"""A tolerance with which the adaptive integrator takes steps nearly as long as `dt`."""
DEFAULT = 1e-10
"""The tolerance of `simulate`, which integrators of fixed steps refuse another one than."""
TOLERANCES = (1e-4, 1e-6, 1e-8, DEFAULT, 1e-12)
"""Its tolerances otherwise."""
LATE = 100.0
"""The adaptive integrator may be late by so many times its tolerance, relative to the quarter."""

ENERGY = 1e-10
"""Drift of the energy with Runge-Kutta at 1 ms from rest at zero, over the largest kinetic energy."""
RANDOM_STARTS = 20
"""Number of falls from random configurations, from which the drift differs by orders of magnitude."""
MOMENTUM = 1e-12
"""Change of momentum in one step [kg m/s, kg m^2/s]."""
SPEED = (0.3, -0.2, 0.5, 1.4, -0.7, 2.6)
"""Initial velocity of the free body: linear [m/s] and angular [rad/s], in its own axes."""


@dataclass(frozen=True)
class Scheme:
    """An integrator, its order, into how many steps the quarter of a period is divided, and its tolerance."""

    title: str
    integrator: str
    order: int
    within: float
    steps: tuple[int, ...]
    tolerance: float = DEFAULT


SCHEMES = (
    Scheme("semi-implicit Euler", "semi_implicit", 1, 0.15, (25, 50, 100, 200, 400)),
    Scheme("Runge-Kutta 4", "rk4", 4, 0.15, (25, 50, 100, 200, 400)),
    # Within each step it chooses its own, so that the order shows less evenly.
    Scheme("adaptive (DOP853), tolerance wide open", "adaptive", 8, 0.5, (1, 2, 4, 8), WIDE_OPEN),
)

Line = tuple[str, bool]
"""Line to print, and whether its figure is within its bound."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what was measured; 1 where something is worse than it should be."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.integrators", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short falls, to see that it runs")
    quick = parser.parse_args(arguments).quick
    sound = True
    falling, floating = (0.5, 0.1) if quick else (10.0, 1.0)
    for line, right in [*orders(), *energies(falling), *momenta(floating)]:
        print(line if right else f"{line}  NOT AS IT SHOULD BE", flush=True)
        sound &= right
    return 0 if sound else 1


# -- the pendulum -----------------------------------------------------------------------------


def orders() -> Iterator[Line]:
    """Errors of the period over the length of the step, and over the tolerance."""
    quarter = quarter_period()
    yield f"Pendulum from {START:g} rad: relative error of a quarter of its period, {quarter:.12f} s", True
    for scheme in SCHEMES:
        yield f"\n{scheme.title}\n  {'dt [ms]':>8}  {'error':>8}  order", True
        errors = [late(scheme.integrator, steps, scheme.tolerance) for steps in scheme.steps]
        for k, (steps, error) in enumerate(zip(scheme.steps, errors, strict=True)):
            local = ""
            if k:
                local = f"{np.log(errors[k - 1] / error) / np.log(steps / scheme.steps[k - 1]):.2f}"
            yield f"  {1e3 * quarter / steps:8.3f}  {error:8.1e}  {local:>5}", True
        fitted = float(np.polyfit(-np.log(scheme.steps), np.log(errors), 1)[0])
        within = abs(fitted - scheme.order) <= scheme.within
        yield f"  fitted order {fitted:.2f}, that of the method is {scheme.order}", within
    yield f"\nadaptive (DOP853), one step\n  {'rtol':>8}  {'error':>8}", True
    for tolerance in TOLERANCES:
        error = late("adaptive", 1, tolerance)
        yield f"  {tolerance:8.0e}  {error:8.1e}", error <= LATE * tolerance


def quarter_period() -> float:
    """The time from `START`, at rest, to the lowest point [s]; mass and weight are those of the model."""
    with backend("reference", load("pendulum")) as pendulum:
        inertia = pendulum.mass_matrix(np.zeros(1))[0, 0]
        weight = pendulum.gravity_torque(np.array([np.pi / 2]))[0]
    return float(ellipk(np.sin(START / 2) ** 2) / np.sqrt(weight / inertia))


def late(integrator: str, steps: int, tolerance: float) -> float:
    """Relative error of a quarter of the period: the angle left at its end, over the speed there."""
    quarter = quarter_period()
    rollout = simulate(
        load("pendulum"),
        q0=[START],
        dt=quarter / steps,
        duration=quarter,
        integrator=integrator,
        rtol=tolerance,
        atol=tolerance / 100,
        joint_damping=False,
        joint_friction=False,
    )
    return float(abs(rollout.q[-1, 0] / rollout.v[-1, 0]) / quarter)


# -- the falling arm --------------------------------------------------------------------------


def energies(duration: float) -> Iterator[Line]:
    """Drift of the energy of UR5 in steps of 1 ms: from rest at zero, and at random configurations."""
    yield (
        f"\nUR5 falls for {duration:g} s, steps of 1 ms: largest change of energy / largest kinetic energy",
        True,
    )
    task = Task()
    for plant, integrator in (("pinocchio", "rk4"), ("compiled", "rk4"), ("pinocchio", "semi_implicit")):
        # Stops take energy.
        options: dict[str, Any] = {"duration": duration, "integrator": integrator, "joint_limits": False}
        rollout = simulate(task.model, dt=DT, plant=plant, **options)
        drift = energy_drift(rollout.q, rollout.v)
        title = f"dynx, {integrator} over {plant}"
        yield f"  {title:36}{drift:8.1e}", integrator != "rk4" or drift <= ENERGY
    drifts = [
        energy_drift(rollout.q, rollout.v)
        for seed in range(RANDOM_STARTS)
        for rollout in [
            simulate(
                task.model,
                q0=task.model.random(seed),
                dt=DT,
                duration=duration,
                plant="compiled",
                integrator="rk4",
                joint_limits=False,
            )
        ]
    ]
    title = f"rk4 over compiled, {RANDOM_STARTS} random starts"
    yield f"  {title:36}{min(drifts):8.1e} to {max(drifts):.1e}, median {np.median(drifts):.1e}", True
    drift = energy_drift(*fall_by_hand(round(duration / DT)))
    yield f"  {'by hand, rk4 over pin.aba':36}{drift:8.1e}", True


def energy_drift(q: Floats, v: Floats) -> float:
    """Largest change of energy over the largest kinetic energy, in a record (n, 6) of UR5."""
    with backend("reference", Task().model) as arm:
        kinetic = arm.kinetic_energy(q, v)
        energy = kinetic + arm.potential_energy(q)
    return float(np.max(np.abs(energy - energy[0])) / np.max(kinetic))


def fall_by_hand(n_steps: int) -> tuple[Floats, Floats]:
    """Configurations and velocities (n_steps + 1, 6), by the classical Runge-Kutta method over `pin.aba`."""
    engine = pinocchio_model(Task().model)
    data, none = engine.createData(), np.zeros(engine.nv)
    Q, V = np.zeros((n_steps + 1, engine.nq)), np.zeros((n_steps + 1, engine.nv))

    def acceleration(q: Floats, v: Floats) -> Floats:
        # The result is memory of the engine, which the next call overwrites.
        return np.array(pin.aba(engine, data, q, v, none))

    for k in range(n_steps):
        q, v = Q[k], V[k]
        a1 = acceleration(q, v)
        v2 = v + 0.5 * DT * a1
        a2 = acceleration(q + 0.5 * DT * v, v2)
        v3 = v + 0.5 * DT * a2
        a3 = acceleration(q + 0.5 * DT * v2, v3)
        v4 = v + DT * a3
        a4 = acceleration(q + DT * v3, v4)
        Q[k + 1] = q + DT / 6.0 * (v + 2.0 * (v2 + v3) + v4)
        V[k + 1] = v + DT / 6.0 * (a1 + 2.0 * (a2 + a3) + a4)
    return Q, V


# -- the free body ----------------------------------------------------------------------------


def momenta(duration: float) -> Iterator[Line]:
    """Largest change of momentum of a free body in a step of 1 ms."""
    yield (
        f"\nFree body for {duration:g} s at 1 ms: largest change of momentum in a step, linear and angular",
        True,
    )
    plants = [("pinocchio", "rk4"), ("pinocchio", "adaptive"), ("pinocchio", "semi_implicit")]
    if "pybullet" in installed_backends():
        plants.append(("pybullet", "engine"))
    body = load("free_body", base="floating").with_gravity(np.zeros(3))
    for plant, integrator in plants:
        rollout = simulate(body, v0=SPEED, dt=DT, duration=duration, plant=plant, integrator=integrator)
        with backend("reference", body) as engine:
            momentum = engine.centroidal_momentum(rollout.q, rollout.v)
        change = np.abs(np.diff(momentum, axis=0))
        linear, angular = float(np.max(change[:, :3])), float(np.max(change[:, 3:]))
        keeps_both = integrator in ("rk4", "adaptive")
        right = max(linear, angular if keeps_both else 0.0) <= MOMENTUM
        title = f"{integrator} over {plant}"
        yield f"  {title:36}{linear:8.1e}  {angular:8.1e}", right


if __name__ == "__main__":
    sys.exit(main())
