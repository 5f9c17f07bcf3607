"""The encoding of ROS 2, read back by the decoder that others use."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from dynx.sim.record.ros_messages import Field, encode_messages, schema_name, schema_text
from dynx.spatial.scalar import Floats

TEXTS = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=9)


def decoded(message: str, data: bytes) -> Any:
    """Messages as mcap-ros2-support reads them."""
    records, decoding = pytest.importorskip("mcap.records"), pytest.importorskip("mcap_ros2.decoder")
    schema = records.Schema(1, schema_text(message).encode(), "ros2msg", schema_name(message))
    return decoding.DecoderFactory().decoder_for("cdr", schema)(data)


@given(
    values=arrays(np.float64, array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=5)),
    names=st.lists(TEXTS, max_size=4),
    frame=TEXTS,
    second=st.integers(0, 2**31 - 1),
    nanosecond=st.integers(0, 10**9 - 1),
)
def test_messages_are_read_back(
    values: Floats, names: list[str], frame: str, second: int, nanosecond: int
) -> None:
    n = len(values)
    fields: list[Field] = [np.full(n, second), nanosecond, frame, len(names), *names]
    for field in (values, -values, values[:, ::-1]):
        # Numbers that are absent are not aligned either.
        fields += [field.shape[1], field] if field.shape[1] else [0]
    encoded = encode_messages(n, fields)
    assert len(encoded) == n
    for row, data in zip(values, encoded, strict=True):
        read = decoded("sensor_msgs/JointState", data)
        stamp = read.header.stamp
        assert (stamp.sec, stamp.nanosec, read.header.frame_id) == (second, nanosecond, frame)
        assert read.name == names
        found = np.array([read.position, read.velocity, read.effort])
        np.testing.assert_array_equal(found, np.array([row, -row, row[::-1]]))


@given(values=arrays(np.float64, (3, 7)), text=TEXTS)
def test_numbers_in_a_row_have_no_length(values: Floats, text: str) -> None:
    encoded = encode_messages(3, [1, 0, np.arange(3), "w", text, values])
    for k, data in enumerate(encoded):
        (read,) = decoded("tf2_msgs/TFMessage", data).transforms
        assert (read.header.stamp.nanosec, read.child_frame_id) == (k, text)
        moved, turned = read.transform.translation, read.transform.rotation
        found = [moved.x, moved.y, moved.z, turned.x, turned.y, turned.z, turned.w]
        np.testing.assert_array_equal(found, values[k])
