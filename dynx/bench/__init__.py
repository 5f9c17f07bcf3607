"""Timing every backend and its peers on the user's own machine and robot, answers checked first.

`Plan` says what is timed and `Session` does it; `document` makes plain numbers of what it found.
`dynx bench` is the command, docs/bench.md the page.
"""

from dynx.bench.cases import Work
from dynx.bench.measurement import Measurement
from dynx.bench.report import document
from dynx.bench.session import Plan, Session, works

__all__ = ["Measurement", "Plan", "Session", "Work", "document", "works"]
