"""Library of robots: names and files of example-robot-data and of the small models that come with dynx.

Only the data files of example-robot-data are used, not its Python loaders, which import an engine. Its robots
have the names of those loaders; a file without a loader is named by its stem, as are the robots of dynx. If
that name is taken, the first folder of its path in the library is prepended (``FOLDER_NAME``), or the source
(``dynx_NAME``) for a file in no folder; if that is taken too, the source and all folders.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib import metadata
from pathlib import Path

from dynx.errors import RobotNotFoundError, shown

EXAMPLE_ROBOT_DATA = "example-robot-data"
DYNX_MODELS = "dynx"
TRAPS = "traps"
"""Folder of dynx's models whose files each contain one cause of disagreement between engines."""

SCENES = "scenes"
"""Folder of the scenes among the models of dynx."""

# Short names of loaders that differ from the stem of the file, by file.
_LOADER_NAMES = {
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf": "alexander",
    "anymal_b_simple_description/robots/anymal-kinova.urdf": "anymal_kinova",
    "anymal_b_simple_description/robots/anymal.urdf": "anymal",
    "anymal_c_simple_description/urdf/anymal.urdf": "anymal_c",
    "asr_twodof_description/urdf/TwoDofs.urdf": "asr_twodof",
    "b1_description/urdf/b1-z1.urdf": "b1_z1",
    "borinot_description/urdf/borinot_flying_arm_2.urdf": "borinot",
    "g1_description/urdf/g1_29dof_rev_1_0.urdf": "g1",
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf": "g1_with_hands",
    "hector_description/robots/quadrotor_base.urdf": "hector",
    "hextilt_description/urdf/hextilt_flying_arm_5.urdf": "hextilt",
    "hyq_description/robots/hyq_no_sensors.urdf": "hyq",
    "iris_description/robots/iris_simple.urdf": "iris",
    "solo_description/robots/solo.urdf": "solo8",
    "talos_data/robots/talos_full_v2.urdf": "talos_full",
    "talos_data/robots/talos_full_v2_box.urdf": "talos_full_box",
    "talos_data/robots/talos_left_arm.urdf": "talos_arm",
    "talos_data/robots/talos_reduced.urdf": "talos",
    "talos_data/robots/talos_reduced_box.urdf": "talos_box",
    "ur_description/urdf/ur10_joint_limited_robot.urdf": "ur10_limited",
    "ur_description/urdf/ur10_robot.urdf": "ur10",
    "ur_description/urdf/ur3_joint_limited_robot.urdf": "ur3_limited",
    "ur_description/urdf/ur3_robot.urdf": "ur3",
    "ur_description/urdf/ur5_joint_limited_robot.urdf": "ur5_limited",
    "ur_description/urdf/ur5_robot.urdf": "ur5",
}


@dataclass(frozen=True)
class LibraryRobot:
    """A robot of the library: its name, file, source and aliases."""

    name: str
    path: Path
    source: str
    aliases: tuple[str, ...] = ()


@lru_cache(maxsize=1)
def robots() -> tuple[LibraryRobot, ...]:
    """List the robots of the library: those of example-robot-data, then dynx's own, each sorted by name.

    The list does not contain the traps of the doctor. dynx searches for robots once per process.

    Names are unique. The alias of a robot is the stem of its file, unless a robot has this name or another
    file has this stem.
    """
    files = [(path, EXAMPLE_ROBOT_DATA, root) for root in example_roots() for path in _urdf_files(root)]
    files += [(path, DYNX_MODELS, root) for root in own_roots() for path in _urdf_files(root)]
    relative = [path.relative_to(root).as_posix() for path, _, root in files]
    names: dict[str, int] = {}
    for index, inside in enumerate(relative):
        if files[index][1] == EXAMPLE_ROBOT_DATA and inside in _LOADER_NAMES:
            names[_LOADER_NAMES[inside]] = index
    named = set(names.values())
    for index, (path, source, _) in enumerate(files):
        if index not in named:
            names[_free_name(path.stem, relative[index], source, names)] = index

    stems = [path.stem for path, _, _ in files]
    entries = []
    for name, index in names.items():
        path, source, _ = files[index]
        alias = path.stem
        unused = alias not in names and stems.count(alias) == 1
        entries.append(LibraryRobot(name, path, source, (alias,) if unused else ()))
    return tuple(sorted(entries, key=lambda entry: (entry.source != EXAMPLE_ROBOT_DATA, entry.name)))


def find(name: str) -> Path:
    """Return the path of the description of a robot, by its name or an alias, else by the name without suffix
    of a file in a package of data (`in_data_package`).

    Raises RobotNotFoundError, listing the nearest names.
    """
    by_name = {alias: entry.path for entry in robots() for alias in entry.aliases}
    by_name.update((entry.name, entry.path) for entry in robots())
    try:
        return by_name[name]
    except KeyError:
        # Imported here, because most robots are found.
        from dynx.model.missing_robot import hint_for_name, in_data_package

        # A file of a policy names robots by this function: a path is none.
        found = in_data_package(name) if re.fullmatch(r"[\w-]+", name) else None
        if found is not None:
            return found
        raise RobotNotFoundError(
            f"no robot {shown(name)} in the library, and no such file{hint_for_name(name, by_name)}"
        ) from None


def _free_name(stem: str, inside: str, source: str, taken: dict[str, int]) -> str:
    if stem not in taken:
        return stem
    folders = inside.split("/")[:-1]
    name = f"{folders[0] if folders else source}_{stem}"
    return name if name not in taken else "_".join([source, *folders, stem])


def _urdf_files(root: Path) -> list[Path]:
    # Descriptions are at most three folders deep; deeper folders hold many mesh files.
    found = {path for depth in ("*", "*/*", "*/*/*", "*/*/*/*") for path in root.glob(f"{depth}.urdf")}
    # Traps are not robots but examples of defects, listed by `dynx.rules.registry`.
    descriptions = (path for path in found if path.relative_to(root).parts[0] != TRAPS)
    return sorted(path for path in descriptions if path.is_file())


def example_roots() -> list[Path]:
    """Return the folder of the robots of example-robot-data in a list, or an empty list if it is missing."""
    for root in _example_candidates():
        if root.is_dir():
            return [root]
    return []


def _example_candidates() -> Iterator[Path]:
    inside = Path("share", EXAMPLE_ROBOT_DATA, "robots")
    try:
        installed = metadata.distribution(EXAMPLE_ROBOT_DATA)
    except metadata.PackageNotFoundError:
        pass
    else:
        yield Path(str(installed.locate_file("cmeel.prefix"))) / inside
    for folder in sys.path:
        yield Path(folder or ".", "cmeel.prefix") / inside
    # A ROS, conda or CMake installation keeps the same tree under its prefix.
    for variable in ("AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH", "CONDA_PREFIX"):
        for prefix in os.environ.get(variable, "").split(os.pathsep):
            if prefix:
                yield Path(prefix) / inside
    yield Path(sys.prefix) / inside


def own_roots() -> list[Path]:
    """Return the folder of dynx's own models in a list, or an empty list if it is missing."""
    # In a wheel the models are inside the package, in a source checkout beside it.
    package = Path(__file__).resolve().parent.parent
    for root in (package / "models", package.parent / "models"):
        if root.is_dir():
            return [root]
    return []


def scene_names() -> tuple[str, ...]:
    """Return the names of the scenes that come with dynx."""
    return tuple(sorted(path.stem for root in own_roots() for path in (root / SCENES).glob("*.toml")))
