"""Loading a URDF file by MuJoCo as users do, after a check for files that would crash it."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from dynx.engines.mujoco.library import MAX_DEPTH, mujoco
from dynx.engines.silence import silence
from dynx.errors import EngineError, UnusableEngineError, nonblank_lines, shown
from dynx.loaded.calls import called_joints
from dynx.loaded.robot import require_file
from dynx.model import Model

CALLS: Mapping[str, str] = {
    "mujoco.no_damping": "model.dof_damping[:] = 0",
    "mujoco.no_friction": "model.dof_frictionloss[:] = 0",
    "mujoco.no_limits": "model.jnt_limited[:] = 0",
    "mujoco.no_mimic": "model.eq_active0[:] = 0",
    "mujoco.exact_inertial_frames": (
        "model.body_sameframe[:] = model.body_simple[:] = model.dof_simplenum[:] = 0"
    ),
    "mujoco.no_contacts": "model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT",
}
"""Remedies at run time: id -> the line of code, which comes after loading and before `mujoco.MjData`."""

FIXED = "model = mujoco.MjModel.from_xml_path(path)"


def load_file(path: Path, model: Model, loading: str, calls: Collection[str]) -> Any:
    """Load the file in MuJoCo by the lines `loading` and apply `calls`; raises EngineError with MuJoCo's
    message if that fails."""
    _refuse_crashes(path, model)
    names: dict[str, Any] = {"mujoco": mujoco, "path": str(path)}
    try:
        with _without_warnings():
            # The lines shown to users are those that are executed.
            exec(loading, names)
            for call, code in CALLS.items():
                if call in calls:
                    exec(code, names)
            _set_joints(names["model"], calls)
    except Exception as error:
        raise EngineError(f"mujoco refuses {path.name}: {_message(error)}") from error
    loaded = names["model"]
    if model.floating:
        name = loaded.body(int(loaded.jnt_bodyid[0])).name if loaded.njnt else "nothing"
        if name != model.root:
            raise UnusableEngineError(
                f"mujoco lets {shown(name)} float instead of the root {shown(model.root)} of {path.name}"
                + (": MuJoCo mistakes a root named 'world' for the world" if model.root == "world" else "")
            )
    return loaded


def loading_lines(*, floating: bool, options: str = "") -> str:
    """Return the documented lines that load a URDF with compiler options, and with a floating base, for which
    MuJoCo's reader has no option."""
    free = "spec.worldbody.first_body().add_freejoint()" if floating else ""
    lines = ("spec = mujoco.MjSpec.from_file(path)", options, free, "model = spec.compile()")
    return "\n".join(filter(None, lines)) if floating or options else FIXED


def _set_joints(loaded: Any, calls: Collection[str]) -> None:
    """Apply those of `calls` that are made on single joints."""
    joints = {loaded.joint(k).name: k for k in range(loaded.njnt)}
    for call, change in _ON_JOINT.items():
        if call not in calls:
            for name in called_joints(calls, call, joints):
                change(loaded, joints[name])


def _free_follower(loaded: Any, joint: int) -> None:
    """Switch off the constraints by which a joint follows another."""
    follows = (loaded.eq_type == mujoco.mjtEq.mjEQ_JOINT) & (loaded.eq_obj1id == joint)
    loaded.eq_active0[follows] = 0


def _disable_damping(loaded: Any, joint: int) -> None:
    loaded.dof_damping[loaded.jnt_dofadr[joint]] = 0


def _disable_friction(loaded: Any, joint: int) -> None:
    loaded.dof_frictionloss[loaded.jnt_dofadr[joint]] = 0


def _disable_limits(loaded: Any, joint: int) -> None:
    loaded.jnt_limited[joint] = 0


_ON_JOINT: Mapping[str, Callable[[Any, int], None]] = {
    "mujoco.no_damping": _disable_damping,
    "mujoco.no_friction": _disable_friction,
    "mujoco.no_limits": _disable_limits,
    "mujoco.no_mimic": _free_follower,
}
"""The calls of `CALLS` that can be made on one joint, by its number."""


@contextmanager
def _without_warnings() -> Iterator[None]:
    """Keep warnings out of stderr, Python's warnings and the log file in the working directory.

    MuJoCo writes that file unless a program handles the warnings.
    """
    before = mujoco.get_mju_user_warning()
    with silence(), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mujoco.set_mju_user_warning(_ignore)
        try:
            yield
        finally:
            mujoco.set_mju_user_warning(before)


def _ignore(message: str) -> None:
    """Handle a warning by doing nothing."""


def _refuse_crashes(path: Path, model: Model) -> None:
    require_file(path)
    depth = {model.root: 1}
    for joint in model.joints:
        depth[joint.child] = depth[joint.parent] + 1
    if max(depth.values()) > MAX_DEPTH:
        raise UnusableEngineError(
            f"{path.name} has {max(depth.values())} links in a row; long chains crash mujoco, so dynx loads "
            f"at most {MAX_DEPTH}"
        )


def _message(error: Exception) -> str:
    # Such as "Error: inertia must satisfy A + B >= C" and "Element name 'arm', id 2".
    return "; ".join(nonblank_lines(error)[:2]) or type(error).__name__
