"""All attacks; those on policies and runs where training is installed."""

from importlib.util import find_spec

from tests.security.attack import ATTACKS
from tests.security.surfaces import (
    arrays,
    description,
    mesh,
    page,
    recording,
    scene,
    socket,
    table,
    world_state,
)

__all__ = [
    "ATTACKS",
    "arrays",
    "description",
    "mesh",
    "page",
    "recording",
    "scene",
    "socket",
    "table",
    "world_state",
]

TRAINING = find_spec("torch") is not None and find_spec("stable_baselines3") is not None
"""True where policies can be trained."""

if TRAINING:
    from tests.security.surfaces import policy as policy
    from tests.security.surfaces import run_folder as run_folder
