"""A viewer in the browser: robots, rollouts, worlds, and two motions laid over each other.

The page is served by viser (extra ``viewer``); ``dynx view`` opens it from the command line.
"""

from typing import TYPE_CHECKING

from dynx.registry import moved_names
from dynx.viewer.viewer import Viewer, view

__all__ = ["Viewer", "view"]

# Hidden from type checkers, which would take any name for an attribute.
if not TYPE_CHECKING:
    __getattr__ = moved_names(__name__, {})
