"""A spinning ball that meets the ground: it slides, sticks or comes back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.impacts import CONTACT_DELAYS, Throw, after_bounce, farthest
from dynx.contacts.scenes import ball_name, balls_above
from dynx.world import Material, Scene, World, ground

RADIUS = 0.1
TIME = 0.1
"""Time [s] at which the first ball meets the ground."""

DURATION = 0.25


class SpinningBall(ContactCase):
    """Homogeneous balls with backspin, which meet the ground at an angle, without gravity."""

    name: ClassVar[str] = "spinning_ball"
    title: ClassVar[str] = "Impact of a spinning ball"
    law: ClassVar[str] = (
        "v' = v - J and w' r = w r - 5/2 J with J = min(mu (u + u'), 2/7 (v + w r)) and u' = e u, for speeds "
        "v along the ground, u of the fall and u' of the rebound, backspin w, radius r, friction mu and "
        "restitution e"
    )
    source: ClassVar[str] = (
        "Coulomb's law for the impulses of rigid bodies (Brody, That's how the ball bounces, The Physics "
        "Teacher 22, 1984)"
    )
    trials: ClassVar[dict[str, Throw]] = {
        "slides": Throw(2.0, 1.0, 1.0, 0.2, 0.0),
        "grips": Throw(1.0, 0.5, 1.0, 1.0, 0.0),
        "slides and rebounds": Throw(2.0, 1.0, 1.0, 0.2, 0.5),
        "comes back": Throw(1.0, 3.0, 2.0, 1.0, 0.5),
    }

    def scene(self, parameters: Throw) -> Scene:
        material = Material(friction=parameters.friction, restitution=parameters.restitution)
        twist = (parameters.speed, 0.0, -parameters.fall, 0.0, -parameters.backspin / RADIUS, 0.0)
        heights = [parameters.fall * (TIME + moment) for moment in CONTACT_DELAYS]
        balls = balls_above(RADIUS, heights, material, spacing=(0.0, 0.5), twist=twist)
        # Without gravity a ball that does not rebound stays on the ground without a force.
        return Scene("spinning_ball", bodies=(ground(material=material), *balls), gravity=(0.0, 0.0, 0.0))

    def measure(self, world: World, parameters: Throw) -> Sequence[Figure]:
        world.run(DURATION)
        twists = [world.state.bodies[ball_name(k)].twist.tolist() for k in range(len(CONTACT_DELAYS))]
        rests_on = ("restitution",) if parameters.restitution else ()
        rebound = parameters.restitution * parameters.fall
        speed, backspin = after_bounce(parameters)
        figures = [
            Figure(
                "speed of the rebound",
                farthest([twist[2] for twist in twists], rebound),
                rebound,
                "m/s",
                parameters.fall,
                rests_on=rests_on,
            )
        ]
        if parameters.slips:
            # The normal impulse is that of the rebound found, which has a figure of its own.
            ratios = [(parameters.speed - twist[0]) / (parameters.fall + twist[2]) for twist in twists]
            found = farthest(ratios, parameters.friction)
            figures.append(
                Figure(
                    "impulse of friction, relative to the normal impulse", found, parameters.friction, "", 1.0
                )
            )
        else:
            found = farthest([twist[0] for twist in twists], speed)
            figures.append(Figure("speed along the ground", found, speed, "m/s", parameters.speed))
        # Friction acts at the ground, so that it leaves the angular momentum about a point there.
        momentum = backspin - 2.5 * speed
        found = farthest([-twist[4] * RADIUS - 2.5 * twist[0] for twist in twists], momentum)
        scale = parameters.backspin + 2.5 * parameters.speed
        figures.append(Figure("angular momentum about the ground, by 2/5 m r", found, momentum, "m/s", scale))
        return figures
