"""Settings that cause violations of laws: each is changed, and the scene is run again.

A setting is the cause of a violation if the law holds in the scene with one of its values and with all that
are farther from the default. Which settings are tried follows from how each engine takes contacts:

- MuJoCo lets slip decay at the rate 1 / `slip_time_constant`, whatever else changes it. Where an impact takes
  slip away faster, because its normal force turns the body, friction keeps the slip up and does work on the
  body. In a contact that sticks, the force is f = A^-1 (-B v - ...) for the velocity v of the point, its
  mobility A and the dampings B. Its power has the term -v A^-1 B v, which is never positive if slip is damped
  like the normal direction, and may be positive otherwise. The shorter the time, the smaller it is.
- A contact of MuJoCo is a spring between accelerations: its force grows with the mass that it meets, which is
  another one when the body leaves than when it came if the body has turned or touches elsewhere.
- Bullet gives an impact the restitution that Newton's law wants, also where friction is reversed in it, which
  may add energy (Kane and Levinson, Dynamics: Theory and Applications, 1985); not below `restitution_speed`.
- Drake's contacts are springs as stiff as `modulus` and `stiffness`, with forces of the beginning of the step
  under `contact_approximation="lagged"`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from dynx.errors import DynxError
from dynx.world import Scene
from tests.world.random_scenes.examination import DT
from tests.world.random_scenes.rest import AT_REST

CANDIDATES: Mapping[str, tuple[tuple[str, tuple[Any, ...]], ...]] = {
    "pybullet": (
        ("contact_erp", (0.01, 0.0)),
        ("restitution_speed", (0.5, 5.0)),
        ("solver_iterations", (400, 2000)),
        ("residual_threshold", (1e-12, 0.0)),
        ("contact_slop", (1e-6, 0.0)),
        ("dt", (DT / 4, DT / 8)),
    ),
    "mujoco": (
        ("slip_time_constant", (0.005, 0.002, 0.001)),
        ("time_constant", (0.01, 0.02, 0.05)),
        ("impratio", (10.0, 1.0)),
        ("tolerance", (1e-12, 0.0)),
        ("constraint_time_constant", (0.02, 0.1)),
        ("ccd_iterations", (200, 1000)),
        ("dt", (DT / 4, DT / 8)),
    ),
    "dynx": (("dt", (DT / 4, DT / 8)),),
    "drake": (
        ("modulus", (1e6, 1e5)),
        ("stiffness", (1e5, 1e4)),
        ("contact_approximation", ("similar",)),
        ("contact_approximation", ("sap",)),
        ("contact_model", ("point",)),
        ("dissipation", (100.0, 1000.0)),
        ("stiction_tolerance", (1e-3, 1e-2)),
        ("dt", (DT / 4, DT / 8)),
    ),
}
"""Settings by engine in the order in which they are tried, each with values ever farther from the default;
``"dt"`` is the step."""

Examination = Callable[..., Mapping[str, float]]
"""Function of a scene, an engine and settings that returns error / bound by law."""


@dataclass(frozen=True)
class Cause:
    """A setting with the first value under which a law holds, and error / bound with that value."""

    setting: str
    value: Any
    excess: float

    def __str__(self) -> str:
        return (
            f"{self.setting}={self.value:g}" if type(self.value) is float else f"{self.setting}={self.value}"
        )


def cause_of(
    scene: Scene, engine: str, law: str, examination: Examination, before: Mapping[str, float]
) -> Cause | None:
    """Return the setting that causes the violation of a law in a scene, or None if none of those that are
    tried does. `before` is the examination without a change."""
    for setting, values in CANDIDATES[engine]:
        runs = [_examined(scene, engine, examination, {setting: value}) for value in values]
        # A law of what is at rest says nothing where less is.
        applies = [each.get(AT_REST, 0.0) >= before.get(AT_REST, 0.0) for each in runs]
        found = [
            each.get(law, math.inf) if holds else math.inf for each, holds in zip(runs, applies, strict=True)
        ]
        kept = len(found)
        while kept and found[kept - 1] <= 1.0:
            kept -= 1
        if kept < len(found):
            return Cause(setting, values[kept], found[kept])
    return None


def _examined(
    scene: Scene, engine: str, examination: Examination, change: Mapping[str, Any]
) -> Mapping[str, float]:
    """Return an examination with a setting changed, nothing if the engine fails."""
    try:
        return examination(scene, engine, **change)
    except DynxError:
        return {}
