"""Which latency a policy bears."""

from pathlib import Path

import numpy as np

from tests.tasks.learning.policies import RULE, given_policy, step
from tests.tasks.robots import cart_pole
from tests.tasks.task import Array, Task, numbers, read_answer, require, require_close

START = (0.0, 0.15, 0.0, 0.0)
DELAYS = range(13)
ANGLE = 0.6
STEPS = 250


def peak_angles() -> Array:
    """Return the largest |angle| within the first 5 s for each delay, until the pole falls."""
    peaks = []
    for delay in DELAYS:
        state = np.array([START])
        waiting, peak = [np.zeros(1)] * delay, 0.0
        for _ in range(STEPS):
            waiting.append(given_policy(state))
            state = step(state, waiting.pop(0))
            peak = max(peak, float(abs(state[0, 1])))
            if peak > ANGLE:
                break
        peaks.append(peak)
    return np.array(peaks)


def check(folder: Path) -> None:
    """Compare with the equations of motion."""
    answer = read_answer(folder, "largest_delay_ms", "peak_angles")
    peaks = peak_angles()
    stays = peaks <= ANGLE
    got = float(numbers("largest_delay_ms", answer["largest_delay_ms"]))
    require(got == 20 * int(np.argmin(stays) - 1), "largest_delay_ms is wrong")
    angles = numbers("peak_angles", answer["peak_angles"], 3)
    require_close("peak_angles", angles, peaks[[2, 4, 6]], 5e-3)


TASK = Task(
    "Which latency does the policy bear?",
    f"""
You have a policy for the cart-pole of cart_pole.urdf:
{RULE}.
Every 20 ms the force is computed from the state and held for 20 ms. On the real machine the force comes
late: a force acts a whole number of 20 ms periods after it was computed.
Until the first one arrives the force is 0.
Each episode starts at rest at position 0 and angle {START[1]} rad. It fails when |angle| exceeds
{ANGLE} rad within 5 s.
1. What is the largest delay, in steps of 20 ms, up to which the policy does not fail?
2. What is the largest |angle| at the ends of the 20 ms periods of the 5 s, with delays of 40, 80 and 120 ms?

Write answer.json: {{"largest_delay_ms": number, "peak_angles": [three angles in rad, to 0.005]}}.
""",
    check,
    {"cart_pole.urdf": cart_pole},
)
