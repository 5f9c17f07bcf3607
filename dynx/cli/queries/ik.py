"""Body of ``dynx ik``: a configuration that brings a frame to a target, or all of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.backends import Backend
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
from dynx.cli.shell.output import console, counted, number, write_json
from dynx.cli.shell.tables import Table
from dynx.distance.avoidance import Avoidance, closest_sentence
from dynx.errors import ArgumentError, NoClosedFormError
from dynx.ik import IKSolutions, closed_form
from dynx.ik.result import TIMED_OUT
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.world import read_scene
from dynx.world.scene.scene import MARGIN


def ik(
    target: Numbers,
    free: str | None,
    frame: str | None,
    q: Numbers,
    every: bool,
    given: Numbers,
    avoid: str | None,
    margin: float | None,
    timeout: float | None,
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
        found = engine.inverse_kinematics(wanted, name, start, free=free, avoid=kept, timeout=timeout)
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
        names = model.position_names
        joints = dict(zip(names, result["q"][model.nq - len(names) :], strict=True))
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
    stopped = "stopped by --timeout, " if result["status"] == TIMED_OUT else ""
    if result.get("collision"):
        return f"{stopped}in collision: {result['collision']}"
    proof = f"; out of reach: {result['proof']}" if result["proof"] else "; not proved out of reach"
    return f"{stopped}target not reached: smallest error {error}, after {iterations} and {restarts}{proof}"


def all_solutions(
    engine: Backend,
    target: Floats,
    frame: str,
    q: Floats | None,
    given: Numbers,
    kept: Avoidance | None,
    avoid: str | None,
    json_path: str | None,
    *,
    note: str,
    frame_is_default: bool,
) -> int:
    """Print every solution with the name of its branch, and where it comes too close to what `kept` keeps
    apart, the closest pair; return the exit code. `avoid` is the scene as the user named it."""
    # The closed form has a fixed base, so that q has an entry for each of these names.
    names = engine.model.joint_names
    if given is not None and not isinstance(given, dict):
        raise ArgumentError("--given takes names and positions, such as joint7=0.5")
    try:
        found = engine.inverse_kinematics(target, frame, q, all_solutions=True, given=given)
    except NoClosedFormError as error:
        advice = frame_advice(engine.model, frame, given or {}, error) if frame_is_default else ""
        raise ArgumentError(_advised(error) + advice) from None
    assert isinstance(found, IKSolutions)
    near = [[] if kept is None else kept.violated(engine, q) for q in found.q]
    result: dict[str, Any] = {
        **document_head(engine),
        "frame": frame,
        "target": target.tolist(),
        "given": given or {},
        "note": "; ".join(filter(None, (note, "" if kept is None else kept.note))),
        **({} if kept is None else {"avoid": avoid}),
        "solutions": [
            {
                "branch": branch,
                "q": found.q[k].tolist(),
                "position_error": float(found.position_error[k]),
                "rotation_error": float(found.rotation_error[k]),
                "arbitrary": [name for name, free in zip(names, found.arbitrary[k], strict=True) if free],
                **({} if kept is None else {"collision": closest_sentence(kept, near[k])}),
            }
            for k, branch in enumerate(found.branches)
        ],
    }
    reached: list[dict[str, Any]] = result["solutions"]
    clear = sum(not solution.get("collision") for solution in reached)
    code = DONE if clear else NEGATIVE_RESULT
    if write_json(result, json_path):
        return code
    out = console()
    out.print(f"{title(result)}: all inverse kinematics of {one_line(frame)}", style="bold")
    if frame_is_default:
        out.print(default_frame_note(frame))
    if result["note"]:
        out.print(result["note"])
    margins = f"; {clear} of {len(reached)} keep all margins" if kept is not None and reached else ""
    out.print(f"{found.message}{margins}", style="green" if clear else "red")
    if reached:
        columns = [str(k + 1) for k in range(len(reached))]
        table = Table("joint", *columns, right=columns, keys=1)
        for k, joint in enumerate(names):
            table.add_row(one_line(joint), *(number(solution["q"][k]) for solution in reached))
        out.print(table)
    for k, solution in enumerate(reached, 1):
        out.print(f"{k} {solution['branch']}: --q {','.join(format(x, '.17g') for x in solution['q'])}")
        if solution.get("collision"):
            out.print(f"  in collision: {solution['collision']}", style="red")
    return code


def _advised(error: NoClosedFormError) -> str:
    """Return the message of an error with the options of this command."""
    if not error.remedies:
        return f"{error.reason}; without --all-solutions a search finds one solution"
    given = ",".join(f"{joint}=POSITION" for joint in error.remedies[0])
    return f"{error.reason}; there is one with --given {given}{error.alternatives}"


MAX_FRAMES = 4
"""Most moving joints that are left out from the tip backwards."""

GRIPPER_WORDS = ("gripper", "finger", "jaw", "hand")
"""Parts of the names of joints that belong to a gripper."""


def frame_advice(model: Model, frame: str, given: Mapping[str, float], error: NoClosedFormError) -> str:
    """Return the clause of an error that says that `frame` is the default, and which frame to choose.

    The frames before the last moving joints are tried. None is suggested where a joint of the arm itself can
    be given, as one of seven.
    """
    default = f"; the frame {one_line(frame)} was chosen by default"
    parents = {joint.child: joint for joint in model.joints}
    link, beyond = frame, set[str]()
    while link in parents and len(beyond) < MAX_FRAMES:
        joint = parents[link]
        link = joint.parent
        if not joint.moves:
            continue
        beyond.update({joint.name} if joint.mimic is None else {joint.name, joint.mimic.joint})
        in_gripper = any(word in joint.name.lower() for word in GRIPPER_WORDS)
        if error.remedies and not in_gripper and not beyond.intersection(error.remedies[0]):
            return default
        other = _tool_of(model, link)
        try:
            closed_form(model, other, {name: q for name, q in given.items() if name not in beyond})
        except NoClosedFormError as failure:
            if not failure.remedies:
                continue
            needed = ",".join(f"{name}=POSITION" for name in failure.remedies[0])
            with_given = f" and --given {needed}{failure.alternatives}"
        else:
            with_given = ""
        return f"{default}; there is a closed form with --frame {one_line(other)}{with_given}"
    return default


def _tool_of(model: Model, link: str) -> str:
    """Return the last link that fixed joints carry on `link`, such as the tool centre point of a hand."""
    fixed = {link}
    last = link
    for joint in model.joints:
        if joint.parent in fixed and not joint.moves:
            fixed.add(joint.child)
            last = joint.child
    return last
