"""All attacks; those on policies and runs where training is installed."""

from tests.security.attack import ATTACKS, TRAINING
from tests.security.surfaces import (
    arrays,
    converted,
    description,
    further_files,
    mesh,
    mjcf,
    page,
    published_files,
    published_pages,
    recording,
    scene,
    sdf,
    socket,
    table,
    viewed_files,
    world_state,
)

__all__ = [
    "ATTACKS",
    "TRAINING",
    "arrays",
    "converted",
    "description",
    "further_files",
    "mesh",
    "mjcf",
    "page",
    "published_files",
    "published_pages",
    "recording",
    "scene",
    "sdf",
    "socket",
    "table",
    "viewed_files",
    "world_state",
]

if TRAINING:
    from tests.security.surfaces import policy as policy
    from tests.security.surfaces import run_folder as run_folder
