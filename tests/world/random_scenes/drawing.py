"""Random scenes by number: each is drawn alone, so that it is the same in every run and program.

Hypothesis varies earlier examples of a run, so that hundreds of scenes of one run resemble a few; the second
example of a run of its own is random.
"""

from __future__ import annotations

from dataclasses import replace

from hypothesis import HealthCheck, Phase, given, seed, settings

from dynx.testing.strategies import scenes
from dynx.testing.strategies.geometry import Strategy
from dynx.world import Material, Scene


def scene_of(number: int) -> Scene:
    """Return a scene of any kind that the strategy has."""
    return _drawn(number, scenes())


def resting_scene_of(number: int) -> Scene:
    """Return a scene of bodies and robots above a ground, without speed, in which contacts have friction but
    no rebound, and no moments besides those of their forces."""
    ground = ("plane", "slope", "hills")[number % 3]
    found = _drawn(number, scenes(ground=ground, moving=False, constraints=False))  # type: ignore[arg-type]
    return replace(
        found,
        robots=tuple(replace(each, material=_dull(each.material)) for each in found.robots),
        bodies=tuple(replace(each, material=_dull(each.material)) for each in found.bodies),
    )


def _dull(material: Material) -> Material:
    return replace(material, restitution=0.0, torsional_friction=0.0, rolling_friction=0.0)


def _drawn(number: int, strategy: Strategy[Scene]) -> Scene:
    found: list[Scene] = []

    @seed(number)
    @settings(
        max_examples=2,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(strategy)
    def note(scene: Scene) -> None:
        found.append(scene)

    note()
    return found[-1]
