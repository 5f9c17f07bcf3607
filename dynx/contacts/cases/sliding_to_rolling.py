"""A ball that starts to slide and ends up rolling."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from dynx.contacts.case import ContactCase, Figure
from dynx.contacts.motion import step_count
from dynx.contacts.scenes import G
from dynx.model import Pose
from dynx.world import Material, Scene, World, ground, sphere

RADIUS = 0.1
FRICTION = 0.5
SPEED = 2.0
"""Speed at the start [m/s]."""

DURATION = 0.4
"""Time [s], more than three times that of the slide."""


class SlidingToRolling(ContactCase):
    """A bowling ball: it slides along a plane until friction has made it roll."""

    name: ClassVar[str] = "sliding_to_rolling"
    title: ClassVar[str] = "Sliding that turns into rolling"
    law: ClassVar[str] = (
        "v = 5/7 v0 after t = 2 v0 / (7 mu g), for the speed v0 of a ball that does not spin at first, and "
        "friction mu"
    )
    source: ClassVar[str] = "conservation of the angular momentum about the point of contact"

    def scene(self, parameters: None) -> Scene:
        material = Material(friction=FRICTION)
        ball = sphere(
            "ball",
            RADIUS,
            mass=1.0,
            pose=Pose((0.0, 0.0, RADIUS)),
            twist=(SPEED, 0.0, 0.0, 0.0, 0.0, 0.0),
            material=material,
        )
        return Scene("bowling ball", bodies=(ground(material=material), ball))

    def measure(self, world: World, parameters: None) -> Sequence[Figure]:
        world.step(step_count(world, DURATION))
        ball = world.state.bodies["ball"]
        rolls, speed = 2.0 * SPEED / (7.0 * FRICTION * G), 5.0 / 7.0 * SPEED
        distance = SPEED * rolls - 0.5 * FRICTION * G * rolls**2 + speed * (world.time - rolls)
        travelled = float(ball.T_world_body[0, 3])
        return [
            Figure("speed", float(ball.twist[0]), speed, "m/s", speed),
            Figure("spin", float(ball.twist[4]), speed / RADIUS, "rad/s", speed / RADIUS),
            Figure("distance", travelled, distance, "m", distance),
        ]
