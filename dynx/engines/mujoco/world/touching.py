"""Contacts of MuJoCo in the convention of dynx: the normal goes from b to a."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.steppers.stepper import TouchingPoint


def read_contacts(
    model: Any, data: Any, geom_collider: tuple[int, ...], *, forces: bool
) -> list[TouchingPoint]:
    """Return the contacts that `data` holds, with the forces of the last step if `forces`."""
    found = []
    force = np.zeros(6)
    for number in range(data.ncon):
        contact = data.contact[number]
        first, second = contact.geom
        # MuJoCo's normal goes from the first geom to the second, and the force acts on the second.
        frame = contact.frame.reshape(3, 3)
        normal, distance = -frame[0], float(contact.dist)
        half = 0.5 * distance * frame[0]
        along, friction = 0.0, np.zeros(3)
        if forces and contact.efc_address >= 0:
            mujoco.mj_contactForce(model, data, number, force)
            along, friction = float(force[0]), -(force[1] * frame[1] + force[2] * frame[2])
        found.append(
            TouchingPoint(
                geom_collider[first],
                geom_collider[second],
                contact.pos - half,
                contact.pos + half,
                normal,
                distance,
                along,
                friction,
            )
        )
    return found
