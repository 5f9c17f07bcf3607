"""Scenes of ``dynx view``: opened as worlds, or recorded in one or two engines."""

from __future__ import annotations

from dynx.cli.shell.progress import progress_bar
from dynx.cli.view.targets import single_engine
from dynx.errors import ArgumentError
from dynx.steppers.registry import installed_worlds
from dynx.viewer.motion import FRAME_RATE, MAX_FRAMES
from dynx.world import World
from dynx.world.comparison import WorldComparison, compare_engines
from dynx.world.scene import read_scene

DEFAULT_STEP = 1e-3
"""Step of a world [s]."""
DEFAULT_DURATION = 2.0
"""Time for which a scene is recorded [s]."""


def open_scene(
    target: str,
    export_path: str | None,
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float | None,
    dt: float | None,
) -> World | WorldComparison:
    """Return the world of a scene, or its recorded motion for an export and for a comparison."""
    scene, step = read_scene(target), DEFAULT_STEP if dt is None else dt
    if export_path is None and not compare:
        if duration is not None:
            raise ArgumentError("--duration is that of a recorded scene: with --compare or --export")
        return World(scene, single_engine(engines) or installed_worlds()[0], step)
    chosen = engines or installed_worlds()[: 2 if compare else 1]
    if len(chosen) != (2 if compare else 1):
        wanted = "two different ones, with --compare" if compare else "one, or two with --compare"
        raise ArgumentError(f"--engine names {', '.join(chosen)}; wanted {wanted}")
    time = DEFAULT_DURATION if duration is None else duration
    samples = min(MAX_FRAMES, max(2, round(FRAME_RATE * time)))
    total = round(1e3 * time) * len(chosen)
    before: dict[str, float] = {}
    with progress_bar(total, words="simulated time [ms]") as advance:

        def progress(engine: str, now: float) -> None:
            before[engine] = now
            advance(round(1e3 * sum(before.values())), f"{engine}, simulated time [ms]")

        return compare_engines(scene, chosen, time, step, samples=samples, progress=progress)
