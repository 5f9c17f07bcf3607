"""Names of links: none overlaps another, and they lie where the camera sees their links."""

from __future__ import annotations

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.viewer.marks import CORNERS, arranged, overlap, rectangle, seen_by

pixels = st.floats(0.0, 300.0)


@given(st.lists(st.tuples(pixels, pixels, st.text("abc_", min_size=1, max_size=12)), max_size=12))
def test_no_name_overlaps_another_and_one_is_hidden_only_without_room(
    labels: list[tuple[float, float, str]],
) -> None:
    points, texts = [label[:2] for label in labels], [label[2] for label in labels]
    corners = arranged(np.array(points).reshape(-1, 2), texts)
    placed = [
        rectangle(point, text, corner)
        for point, text, corner in zip(points, texts, corners, strict=True)
        if corner is not None
    ]
    assert not any(overlap(a, b) for a, b in combinations(placed, 2))
    for point, text, corner in zip(points, texts, corners, strict=True):
        if corner is None:
            assert all(
                any(overlap(rectangle(point, text, each), other) for other in placed) for each in CORNERS
            )


def test_names_behind_the_camera_are_hidden() -> None:
    assert arranged(np.array([[np.nan, np.nan], [10.0, 10.0]]), ["a", "b"]) == [None, "top-left"]


def test_points_lie_in_the_picture_as_a_pinhole_camera_sees_them() -> None:
    camera = SimpleNamespace(
        position=(0.0, -4.0, 1.0),
        look_at=(0.0, 0.0, 1.0),
        up_direction=(0.0, 0.0, 1.0),
        fov=np.pi / 2,
        image_width=800,
        image_height=400,
    )
    points = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, -5.0, 1.0]])
    found = seen_by(camera, points)
    # The picture is 8 m wide at a distance of 4 m, z is up.
    assert np.allclose(found[:3], [[400.0, 200.0], [450.0, 200.0], [400.0, 150.0]])
    assert np.isnan(found[3]).all()


def test_names_of_a_robot_are_shown_and_hidden() -> None:
    with dynx.load("six_axis_arm").view() as viewer:
        marks = viewer.view._marks
        for shown in (True, False, True):
            marks.show("names", shown)
            (labels,) = marks._nodes["names"]
            assert {label.visible for label in labels._labels} == {shown}
            viewer.view.put(np.full(6, 0.3))


@pytest.mark.parametrize("width", [1280, 400])
def test_in_a_page_no_name_overlaps_another(width: int) -> None:
    """The camera of a page that is opened arranges the names; `put` arranges them anew."""
    camera = SimpleNamespace(
        position=(1.0, -1.0, 0.7),
        look_at=(0.0, 0.0, 0.3),
        up_direction=(0.0, 0.0, 1.0),
        fov=1.3,
        image_width=width,
        image_height=800,
    )
    model = dynx.load("seven_axis_arm")
    with model.view() as viewer:
        viewer.view._marks.show("names", True)
        (labels,) = viewer.view._marks._nodes["names"]
        labels._moved(camera)
        for q in (np.zeros(7), model.random(3)):
            viewer.view.put(q)
            shown = [
                rectangle(point, name, label.anchor)
                for name, label, point in zip(
                    labels._names, labels._labels, seen_by(camera, labels._points()), strict=True
                )
                if label.visible
            ]
            assert len(shown) >= 2
            assert not any(overlap(a, b) for a, b in combinations(shown, 2))
