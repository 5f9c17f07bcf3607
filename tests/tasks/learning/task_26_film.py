"""A film of a rollout."""

import re
import subprocess
from pathlib import Path

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from tests.tasks.learning.policies import RULE, given_policy, step
from tests.tasks.robots import cart_pole
from tests.tasks.student.task_06_picture import projection, red_pixels
from tests.tasks.task import Array, Task, Wrong, existing, require

START = (-0.5, 0.3, 0.0, 0.0)
EYE, TARGET = (0.0, -4.0, 0.8), (0.0, 0.0, 0.5)
FIELD = 45.0  # vertical [deg]
WIDTH, HEIGHT = 640, 480
FRAMES = 100
RADIUS = 0.07


def description() -> str:
    """Return the cart-pole with a red ball without mass at the pole's end."""
    return cart_pole(
        f"""\
  <link name="top">
    <visual>
      <geometry><sphere radius="{RADIUS}"/></geometry>
      <material name="red"><color rgba="1 0 0 1"/></material>
    </visual>
  </link>
"""
    )


def pixels_of_ball() -> Array:
    """Return where the ball is in each frame (column, row)."""
    state, pixels = np.array([START]), []
    for _ in range(FRAMES):
        x, angle = state[0, :2]
        top = np.array([x + np.sin(angle), 0, np.cos(angle)])
        pixels.append(projection(top, np.array(EYE), np.array(TARGET), (WIDTH, HEIGHT), FIELD)[0])
        for _ in range(2):
            state = step(state, given_policy(state))
    return np.array(pixels)


def _frames(path: Path) -> NDArray[np.uint8]:
    """Return the frames (n, height, width, 3) of a film."""
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    run = subprocess.run(
        [ffmpeg, "-i", path, "-f", "rawvideo", "-pix_fmt", "rgb24", "-"], capture_output=True
    )
    size = re.search(r"Video: .*, (\d+)x(\d+)", run.stderr.decode(errors="replace"))
    if size is None:
        raise ValueError("it has no video")
    return np.frombuffer(run.stdout, np.uint8).reshape(-1, int(size[2]), int(size[1]), 3)


def check(folder: Path) -> None:
    """Compare the ball's place in each frame with a projection of the simulated motion."""
    names = [name for name in ("answer.mp4", "answer.gif") if (folder / name).is_file()]
    path = existing(folder, names[0] if names else "answer.mp4")
    try:
        frames = _frames(path)
    except (OSError, ValueError, RuntimeError) as error:
        raise Wrong(f"{path.name} cannot be read as a film: {error}") from None
    require(abs(len(frames) - FRAMES) <= 1, f"the film has {len(frames)} frames, not {FRAMES}")
    shape = np.shape(frames[0])
    require(shape[:2] == (HEIGHT, WIDTH), f"a frame is {shape[1]} x {shape[0]}")
    for index, (frame, want) in enumerate(zip(frames, pixels_of_ball(), strict=False)):
        pixels = red_pixels(np.asarray(frame, dtype=float)[..., :3])
        require(len(pixels) > 100, f"frame {index} shows no red ball")
        distance = np.linalg.norm(pixels.mean(axis=0) - want)
        require(distance < 12, f"in frame {index} the ball is {distance:.0f} pixels from where it should be")


TASK = Task(
    "A film of a rollout",
    f"""
Make a film of this policy on the cart-pole of cart_pole.urdf (with a red ball at the pole's end; the
ball has no mass):
{RULE}.
Every 20 ms the force is computed from the state and held. There is no friction. The start is at rest at
position {START[0]} m and angle {START[1]} rad. The camera stands at {EYE} m, looks at {TARGET} m, z is
up, and its vertical field of view is {FIELD:.0f} degrees.

Write answer.mp4 (or answer.gif): {FRAMES} frames of {WIDTH} x {HEIGHT} pixels, 25 a second of simulated
time; the first shows the start.
""",
    check,
    {"cart_pole.urdf": description},
)
