"""How far two readings of a robot are apart."""

from __future__ import annotations

from dynx.doctor.examine.examination import change
from dynx.doctor.examine.right_answers import Truth, draw_states, find_truth
from dynx.rules import Case
from dynx.spatial.scalar import Floats


def distance(one: Case, other: Case) -> float:
    """How far two readings are apart: poses, mass matrix and torque at the same states, relative."""
    first, second = one.model, other.model
    assert len(first.joint_names) == len(second.joint_names)
    states = draw_states(first, 3, 0)
    right, left = find_truth(first, states), find_truth(second, states)
    kept = [link.name for link in first.links if link.name in {each.name for each in second.links}]
    return max(
        change({"": a}, {"": b}) / (abs(a).max(initial=0.0) or 1.0)
        for a, b in [
            (poses_of(right, kept), poses_of(left, kept)),
            (right.mass_matrix, left.mass_matrix),
            (right.torque, left.torque),
        ]
    )


def poses_of(truth: Truth, links: list[str]) -> Floats:
    """Poses (n, links, 4, 4)."""
    names = [link.name for link in truth.model.links]
    return truth.poses[:, [names.index(link) for link in links]]
