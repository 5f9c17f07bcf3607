"""Body of ``dynx ik``: a configuration that brings a frame to a target."""

from __future__ import annotations

from typing import Any

from dynx.cli.queries.all_solutions import all_solutions
from dynx.cli.queries.evaluate import document_head, title
from dynx.cli.shell.exits import DONE, NEGATIVE_RESULT, one_line
from dynx.cli.shell.inputs import (
    Numbers,
    angle_note,
    chosen_frame,
    configuration,
    default_frame_note,
    open_backend,
    target_pose,
    target_rotation,
)
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, counted, number, write_json
from dynx.errors import ArgumentError
from dynx.world.scene import read_scene
from dynx.world.scene.avoidance import MARGIN


def ik(
    target: Numbers,
    free: str | None,
    frame: str | None,
    q: Numbers,
    every: bool,
    given: Numbers,
    avoid: str | None,
    margin: float | None,
    json_path: str | None,
    **robot: Any,
) -> int:
    """Print the configuration found; return the exit code."""
    note = angle_note(target, "--to-pose", rotation_only=free == "position")
    wanted = (target_rotation if free == "position" else target_pose)(target, "--to-pose")
    if every and (free is not None or wanted.ndim == 1):
        raise ArgumentError(
            "--all-solutions wants a whole pose: a position and roll,pitch,yaw, without --free"
        )
    if given is not None and not every:
        raise ArgumentError("--given has an effect only with --all-solutions; --lock fixes a joint otherwise")
    if margin is not None and avoid is None:
        raise ArgumentError("--margin is the distance that --avoid SCENE keeps; give the scene as well")
    if wanted.ndim == 1:
        free = "rotation"
    scene = None if avoid is None else read_scene(avoid)
    with open_backend(**robot) as engine:
        model = engine.model
        name = chosen_frame(model, frame)
        start = None if q is None else configuration(model, q)
        kept = None
        if scene is not None:
            kept = scene.avoidance_for(model, margin=MARGIN if margin is None else margin)
        if every:
            by_default = frame is None
            return all_solutions(
                *(engine, wanted, name, start, given, kept, avoid, json_path),
                note=note,
                frame_is_default=by_default,
            )
        found = engine.inverse_kinematics(wanted, name, start, free=free, avoid=kept)
        result = {
            **document_head(engine),
            "frame": name,
            "target": wanted.tolist(),
            "free": free,
            "success": bool(found.success),
            "q": found.q.tolist(),
            "position_error": None if free == "position" else float(found.position_error),
            "rotation_error": None if free == "rotation" else float(found.rotation_error),
            "iterations": int(found.iterations),
            "restarts": int(found.restarts),
            "status": found.status,
            "message": found.message,
            "proof": "" if found.proof is None else str(found.proof),
            "note": "; ".join(filter(None, (found.note, note))),
        }
        if kept is not None:
            result["avoid"] = avoid
            result["collision"] = "" if found.collision is None else str(found.collision)
        joints = dict(zip(model.joint_names, result["q"][model.nq - len(model.joint_names) :], strict=True))
    code = DONE if result["success"] else NEGATIVE_RESULT
    if write_json(result, json_path):
        return code
    out = console()
    out.print(f"{title(result)}: inverse kinematics of {one_line(name)}", style="bold")
    if frame is None:
        out.print(default_frame_note(name))
    out.print(_outcome(result), style="green" if result["success"] else "red")
    for line in filter(None, (found.note, note)):
        out.print(line)
    table = Table("joint", "q", right=("q",))
    for joint, value in joints.items():
        table.add_row(one_line(joint), number(value))
    out.print(table)
    out.print(f"--q {','.join(format(value, '.17g') for value in result['q'])}")
    return code


def _outcome(result: dict[str, Any]) -> str:
    """State whether the target was reached, the errors, and the number of iterations and restarts."""
    errors = ((result["position_error"], "m"), (result["rotation_error"], "rad"))
    error = " and ".join(f"{value:.3g} {unit}" for value, unit in errors if value is not None)
    iterations, restarts = counted(result["iterations"], "iteration"), counted(result["restarts"], "restart")
    if result["success"]:
        clear = ", margins kept" if "avoid" in result else ""
        return f"target reached{clear}: error {error}, after {iterations} and {restarts}"
    if result.get("collision"):
        return f"in collision: {result['collision']}"
    proof = f"; out of reach: {result['proof']}" if result["proof"] else "; not proved out of reach"
    return f"target not reached: smallest error {error}, after {iterations} and {restarts}{proof}"
