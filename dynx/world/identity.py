"""Hash of what an engine was given, by which a saved state is matched to its world."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from dynx.model import Model
from dynx.model.geometry import Mesh
from dynx.steppers.layout import Layout


def identity(layout: Layout, options: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a layout and of the options of its world."""
    digest = hashlib.sha256()
    _feed(digest, layout)
    _feed(digest, sorted(options.items()))
    return digest.hexdigest()


def _feed(digest: Any, value: Any) -> None:
    digest.update(type(value).__name__.encode())
    if isinstance(value, np.ndarray):
        digest.update(repr(value.shape).encode() + np.ascontiguousarray(value).tobytes())
    elif isinstance(value, Model):
        for part in (value.name, value.base, value.base_pose, value.gravity, value.links, value.joints):
            _feed(digest, part)
    elif isinstance(value, Mesh):
        # The content of the file, not its place.
        _feed(digest, value.hull)
    elif is_dataclass(value):
        for field in fields(value):
            if field.compare:
                _feed(digest, getattr(value, field.name))
    elif isinstance(value, tuple | list):
        digest.update(repr(len(value)).encode())
        for each in value:
            _feed(digest, each)
    else:
        digest.update(repr(value).encode())
