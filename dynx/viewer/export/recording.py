"""A page that plays a motion without a server: one HTML file that needs no network."""

from __future__ import annotations

import os
from collections.abc import Callable

from dynx.errors import ArgumentError, shown
from dynx.files.reading import checked_path
from dynx.files.writing import write_bytes
from dynx.viewer.browser.client import standalone
from dynx.viewer.page import Page

UPDATES_PER_SECOND = 30.0
"""Rate at which the recorded page moves."""


def write_recording(
    path: str | os.PathLike[str],
    page: Page,
    show: Callable[[float], None],
    duration: float,
    *,
    title: str,
    legend: str = "",
) -> None:
    """Write an HTML file in which the scene of the page plays as `show(time)` places it, for `duration` [s].

    A duration of 0 gives a still scene; `legend` is HTML over the corner of the picture. Raises
    ArgumentError for a file that cannot be written.
    """
    if not checked_path(path).lower().endswith((".html", ".htm")):
        wanted = "wanted .html (a page), .gif (a film) or .png (a picture)"
        raise ArgumentError(f"{shown(os.path.basename(path))} has no suffix of a page; {wanted}")
    with page.lock:
        show(0.0)
        recorder = page.server.get_scene_serializer()
        count = round(duration * UPDATES_PER_SECOND)
        for k in range(1, count + 1):
            recorder.insert_sleep(duration / count)
            show(duration * k / count)
        # The last picture stays for a moment before the recording begins again.
        recorder.insert_sleep(1.0 if count else 0.0)
        text = recorder.as_html(page.dark)
    text = standalone(text, title, page.part_names, legend=legend, software=page.plain)
    write_bytes(path, text.encode())
