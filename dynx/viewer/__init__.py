"""A viewer in the browser: robots, rollouts, worlds, and two motions laid over each other.

The page is served by viser (extra ``viewer``); ``dynx view`` opens it from the command line.
"""

from dynx.viewer.viewer import Viewer, view

__all__ = ["Viewer", "view"]
