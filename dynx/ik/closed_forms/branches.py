"""Branches of the solutions: eight choices of three signs, with names that state their geometry.

With h_i the axes of the joints as they stand at the solution, a chain whose wrist is spherical (or whose axes
2, 3 and 4 are parallel) has the branches

- shoulder right, if the wrist centre (the point where axes 5 and 6 meet) lies on that side of axis 1 to which
  h_1 x h_2 points, and otherwise shoulder left;
- elbow up, if axis 3 passes on the side of h_1 of the line from axis 2 to the wrist centre (to axis 4) when
  that line points to the right; seen from the left it then passes on the opposite side. Otherwise elbow
  down;
- wrist unflipped, if h_5' (h_4 x h_6) > 0, and otherwise wrist flipped.

For the inverse chain (the first three axes meet, or axes 3, 4 and 5 are parallel) read 6, 5, ..., 1 for 1,
2, ..., 6 and exchange the words shoulder and wrist. If axes 1 and 2 are parallel, elbow and forearm take the
place of shoulder and elbow: elbow right, if the wrist centre lies to the right of the line from axis 1 to
axis 2 (on the side of that direction x h_2), and forearm up, if the height of the wrist centre along h_2
rises with q_3. If axes 1, 2 and 3 are parallel, the wrists have numbers, in no order, and elbow right says
that axis 2 passes to the right of the line from axis 1 to axis 3, seen against h_1. If a quartic is solved,
its roots have numbers, in no order, as have arms with prismatic joints before a spherical wrist; of
three parallel axes alone elbow right says the same as for axes 1, 2 and 3. Other branches change only at a
singularity.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from dynx.ik.closed_forms.outer_parallel_axes import OuterParallelAxes
from dynx.ik.closed_forms.parallel_arm import ParallelArm
from dynx.ik.closed_forms.parallel_axes import ParallelAxes
from dynx.ik.closed_forms.recognition import Recognised
from dynx.ik.closed_forms.sliding_arm import SlidingArm
from dynx.ik.closed_forms.spherical_wrist import SphericalWrist
from dynx.ik.closed_forms.three_slides import ThreeSlides
from dynx.spatial.scalar import Floats

SIGNS: Floats = np.array(list(product((1.0, -1.0), repeat=3)))
"""Signs (8, 3) that select the solutions."""

N_BRANCHES = len(SIGNS)


def branch_names(recognised: Recognised) -> tuple[str, ...]:
    """Return the names of the eight branches, in the order of `SIGNS`."""
    first, last = ("wrist", "shoulder") if recognised.inverted else ("shoulder", "wrist")
    found = []
    for number, signs in enumerate(SIGNS.tolist()):
        if isinstance(recognised.geometry, OuterParallelAxes):
            arm, elbow, wrist = signs
            right = (elbow > 0.0) == (float(recognised.geometry.axes[0] @ recognised.geometry.axes[1]) > 0.0)
            place = 1 + 2 * (arm < 0.0) + (wrist < 0.0)
            found.append(f"{last} {place}, elbow {'right' if right else 'left'}")
            continue
        if isinstance(recognised.geometry, ThreeSlides | ParallelArm | SlidingArm):
            found.append(_with_slides(recognised.geometry, signs, last))
            continue
        arm, unflipped = _sides(recognised.geometry, signs)
        flip = f"{last} {'unflipped' if unflipped else 'flipped'}"
        found.append(f"{arm.format(first=first, number=number // 2 + 1)}, {flip}")
    return tuple(found)


def _with_slides(geometry: ThreeSlides | ParallelArm | SlidingArm, signs: list[float], last: str) -> str:
    """Return the name of a branch of an arm with prismatic joints. Signs that select nothing are 1."""
    arm, elbow, wrist = signs
    place = 1 + 2 * (arm < 0.0) + (elbow < 0.0)
    if isinstance(geometry, ParallelArm):
        plane = geometry.plane.axes
        right = (elbow > 0.0) == (float(plane[0] @ plane[1]) > 0.0)
        return f"elbow {'right' if right else 'left'}"
    flip = f"{last} {'unflipped' if wrist > 0.0 else 'flipped'}"
    return flip if isinstance(geometry, ThreeSlides) else f"arm {place}, {flip}"


def _sides(geometry: SphericalWrist | ParallelAxes, signs: list[float]) -> tuple[str, bool]:
    """Return the name of the arm's branch, and whether the wrist is unflipped."""
    h, (arm, elbow, wrist) = geometry.axes, signs
    if isinstance(geometry, SphericalWrist):
        right, unflipped = arm > 0.0, wrist > 0.0
        if geometry.case == "parallel_1_2":
            return (
                f"elbow {'right' if right else 'left'}, forearm {'down' if elbow > 0.0 else 'up'}",
                unflipped,
            )
    else:
        right, unflipped = arm < 0.0, wrist * float(h[1] @ h[3]) > 0.0
    up = (elbow < 0.0) == (right == (float(h[1] @ h[2]) >= 0.0))
    if geometry.case == "general":
        if isinstance(geometry, SphericalWrist):
            return "arm {number}", unflipped
        return f"{{first}} and wrist {{number}}, elbow {'up' if elbow < 0.0 else 'down'}", unflipped
    return f"{{first}} {'right' if right else 'left'}, elbow {'up' if up else 'down'}", unflipped
