"""A model as a table on a page, such as that of a notebook."""

from __future__ import annotations

from dynx.files.pages import html_grid
from dynx.model.model import Model


def model_page(model: Model) -> str:
    """Return the joints with a coordinate, and their limits, as HTML."""
    rows = (
        (
            joint.name,
            joint.type,
            joint.parent,
            joint.child,
            *(f"{x:.4g}" for x in (joint.limits.lower, joint.limits.upper)),
            *(f"{x:.4g}" for x in (joint.limits.velocity, joint.limits.effort)),
        )
        for joint in model.coordinate_joints
    )
    head = ("joint", "type", "parent", "child", "lower", "upper", "velocity", "effort")
    return html_grid(f"{repr(model)[1:-1]}, {model.total_mass:.6g} kg", head, rows)
