"""The version of dynx and the name of its distribution, in one place."""

__version__ = "0.1.0"
DISTRIBUTION = "dynx-robotics"
"""Name under which packages of dynx are built and installed; `dynx` is another project's on the index."""
