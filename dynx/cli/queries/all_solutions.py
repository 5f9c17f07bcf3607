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
from dynx.errors import ArgumentError, NoClosedFormError
from dynx.ik import IKSolutions
from dynx.spatial.scalar import Floats


def all_solutions(
    engine: Backend,
    target: Floats,
    frame: str,
    q: Floats | None,
    given: Numbers,
    json_path: str | None,
    *,
    note: str,
    frame_is_default: bool,
) -> int:
    """Print every solution with the name of its branch; return the exit code."""
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
    result: dict[str, Any] = {
        **document_head(engine),
        "frame": frame,
        "target": target.tolist(),
        "given": given or {},
        "note": note,
        "solutions": [
            {
                "branch": branch,
                "q": found.q[k].tolist(),
                "position_error": float(found.position_error[k]),
                "rotation_error": float(found.rotation_error[k]),
                "arbitrary": [name for name, free in zip(names, found.arbitrary[k], strict=True) if free],
            }
            for k, branch in enumerate(found.branches)
        ],
    }
    code = DONE if result["solutions"] else NEGATIVE_RESULT
    if write_json(result, json_path):
        return code
    out = console()
    out.print(f"{title(result)}: all inverse kinematics of {one_line(frame)}", style="bold")
    if frame_is_default:
        out.print(default_frame_note(frame))
    if note:
        out.print(note)
    out.print(found.message, style="green" if result["solutions"] else "red")
    if result["solutions"]:
        columns = [str(k + 1) for k in range(len(result["solutions"]))]
        table = Table("joint", *columns, right=columns, keys=1)
        for k, joint in enumerate(names):
            table.add_row(one_line(joint), *(number(solution["q"][k]) for solution in result["solutions"]))
        out.print(table)
    for k, solution in enumerate(result["solutions"], 1):
        out.print(f"{k} {solution['branch']}: --q {','.join(format(x, '.17g') for x in solution['q'])}")
    return code


def _advised(error: NoClosedFormError) -> str:
    """Return the message of an error with the options of this command."""
    if not error.remedies:
        return f"{error.reason}; without --all-solutions a search finds one solution"
    given = ",".join(f"{joint}=POSITION" for joint in error.remedies[0])
    return f"{error.reason}; there is one with --given {given}{error.alternatives}"
