"""A target of worker processes whose import takes longer than the time limit of its tasks."""

from __future__ import annotations

import time

time.sleep(2.5)


def name_of(task: str) -> str:
    return task
