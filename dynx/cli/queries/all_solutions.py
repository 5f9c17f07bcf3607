"""Body of ``dynx ik --all-solutions``: every configuration that brings a frame to a pose."""

from __future__ import annotations

from typing import Any

from dynx.backends import Backend
from dynx.cli.queries.closed_form_frame import frame_advice
from dynx.cli.queries.evaluate import document_head, title
from dynx.cli.shell.exits import DONE, NEGATIVE_RESULT, one_line
from dynx.cli.shell.inputs import Numbers, default_frame_note
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import console, number, write_json
from dynx.distance.avoidance import Avoidance, closest_sentence
from dynx.errors import ArgumentError, NoClosedFormError
from dynx.ik import IKSolutions
from dynx.spatial.scalar import Floats


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
