"""A spinning ball that meets the ground: sliding, gripping and coming back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import Case, Figure
from dynx.contacts.impacts import SPREAD, Throw, after_bounce, farthest
from dynx.model import Pose
from dynx.world import Material, Scene, World, ground, sphere

RADIUS = 0.1
HEIGHTS = tuple(0.1 + k * SPREAD for k in range(5))
"""Heights of the lowest points at the start [m]."""

DURATION = 0.25
"""Time [s] by which every ball has met the ground."""


class SpinningBall(Case):
    """Homogeneous balls with backspin, which meet the ground at an angle, without gravity."""

    name: ClassVar[str] = "spinning_ball"
    title: ClassVar[str] = "Impact of a spinning ball"
    law: ClassVar[str] = (
        "v' = v - J and w' r = w r - 5/2 J with J = min(mu (1 + e) u, 2/7 (v + w r)), for the speed v along "
        "the ground, the backspin w, the speed u of the fall, friction mu and restitution e"
    )
    source: ClassVar[str] = (
        "Coulomb's law for the impulses of rigid bodies (Brody, That's how the ball bounces, The Physics "
        "Teacher 22, 1984)"
    )
    trials: ClassVar[dict[str, Throw]] = {
        "slides": Throw(2.0, 1.0, 1.0, 0.2, 0.0),
        "grips": Throw(1.0, 0.5, 1.0, 1.0, 0.0),
        "slides and rebounds": Throw(2.0, 1.0, 1.0, 0.2, 0.5),
        "comes back": Throw(1.0, 3.0, 1.0, 1.0, 0.5),
    }

    def scene(self, parameters: Throw) -> Scene:
        material = Material(friction=parameters.friction, restitution=parameters.restitution)
        twist = (parameters.speed, 0.0, -parameters.fall, 0.0, -parameters.backspin / RADIUS, 0.0)
        balls = [
            sphere(
                name,
                RADIUS,
                mass=1.0,
                pose=Pose((0.0, 0.5 * k, RADIUS + HEIGHTS[k])),
                twist=twist,
                material=material,
            )
            for k, name in enumerate(_balls())
        ]
        # Without gravity a ball that does not rebound stays on the ground without a force.
        return Scene("spinning_ball", bodies=(ground(material=material), *balls), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: Throw) -> Sequence[Figure]:
        world.run(DURATION)
        twists = [world.state.bodies[name].twist for name in _balls()]
        speed, backspin = after_bounce(parameters)
        rests_on = ("restitution",) if parameters.restitution else ()
        return [
            Figure(
                "speed along the ground",
                farthest([float(twist[0]) for twist in twists], speed),
                speed,
                "m/s",
                parameters.speed,
                rests_on=rests_on,
            ),
            Figure(
                "speed of the surface by backspin",
                farthest([float(-twist[4] * RADIUS) for twist in twists], backspin),
                backspin,
                "m/s",
                parameters.speed,
                rests_on=rests_on,
            ),
        ]


def _balls() -> list[str]:
    return [f"ball {k}" for k in range(len(HEIGHTS))]
