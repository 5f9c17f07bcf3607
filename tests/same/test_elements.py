"""Elements whose values are in a frame that another element moves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import dynx
from dynx.model.elements import Pose
from dynx.same.elements import DifferingElement, FieldChange, _in_moved_frames, apply
from dynx.spatial.se3 import homogeneous


def element(*changes: FieldChange, **more: object) -> DifferingElement:
    """Return an element with these changes."""
    first = changes[0]
    return DifferingElement(
        "origin",
        first.tag,
        first.name,
        first.name,
        1.0,
        "",
        "",
        "",
        changes,
        **more,  # type: ignore[arg-type]
    )


def test_values_attached_to_a_link_with_a_moved_frame_are_in_its_new_frame() -> None:
    arm = dynx.load("six_axis_arm")
    joint = arm.joint("joint4")
    link = arm.link(joint.child)
    (child,) = (each for each in arm.joints if each.parent == link.name)
    assert link.inertial is not None
    there, back = (homogeneous(np.eye(3), sign * np.array([0.0, 0.03, 0.02])) for sign in (1.0, -1.0))

    def moved(T: np.ndarray) -> Pose:
        return Pose.from_matrix(back @ T)

    # The joint is moved, and what is attached to its link is moved back.
    inertial = replace(link.inertial, origin=moved(link.inertial.origin.matrix))
    axis = element(
        FieldChange("joint", joint.name, "origin", Pose.from_matrix(joint.origin.matrix @ there)),
        FieldChange("link", link.name, "inertial", inertial),
        FieldChange("joint", child.name, "origin", moved(child.origin.matrix)),
        moved_link=(link.name, back),
    )
    alone = apply(arm, (change for each in _in_moved_frames([axis], arm) for change in each.changes))
    assert alone.link(link.name).inertial == inertial
    # Its mass and the place of the next joint differ as well: each is stated once, in the new frame.
    heavier = replace(link.inertial, mass=9.0)
    placed = Pose((0.4, 0.1, 0.0), (0.1, 0.2, 0.3))
    others = [
        element(FieldChange("joint", child.name, "origin", placed)),
        element(FieldChange("link", link.name, "inertial", heavier)),
    ]
    for order in ([axis, *others], [*others, axis]):
        found = [change for each in _in_moved_frames(order, arm) for change in each.changes]
        assert len({(change.tag, change.name) for change in found}) == len(found) == 3
        together = apply(arm, found)
        assert together.joint(joint.name).origin == axis.changes[0].value
        assert together.link(link.name).inertial == replace(heavier, origin=inertial.origin)
        np.testing.assert_allclose(
            together.joint(child.name).origin.matrix, back @ placed.matrix, rtol=0.0, atol=1e-15
        )
