"""Difference between two readings of a robot."""

from __future__ import annotations

from dynx.doctor.examination import ReferenceValues, draw_states, max_change, reference_values
from dynx.rules import Case
from dynx.spatial.scalar import Floats


def reading_difference(one: Case, other: Case) -> float:
    """Return the largest relative difference of poses, mass matrix and torque at equal states."""
    first, second = one.model, other.model
    assert len(first.joint_names) == len(second.joint_names)
    states = draw_states(first, 3, 0)
    right, left = reference_values(first, states), reference_values(second, states)
    kept = [link.name for link in first.links if link.name in {each.name for each in second.links}]
    return max(
        max_change({"": a}, {"": b}) / (abs(a).max(initial=0.0) or 1.0)
        for a, b in [
            (poses_of(right, kept), poses_of(left, kept)),
            (right.mass_matrix, left.mass_matrix),
            (right.torque, left.torque),
        ]
    )


def poses_of(reference: ReferenceValues, links: list[str]) -> Floats:
    """Return the poses (n, links, 4, 4) of `links`."""
    names = [link.name for link in reference.model.links]
    return reference.poses[:, [names.index(link) for link in links]]
