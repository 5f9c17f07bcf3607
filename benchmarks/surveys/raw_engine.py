"""One engine alone, as a script: ``python raw_engine.py ENGINE TASKS.json ANSWERS.json``. No dynx in here.

A task is {path, floating, joints, links, gravity, states: [{base, q, v, a}]}: joints and links by name;
q by joint; base is None or [x, y, z, qx, qy, qz, qw]; v and a begin with the linear and angular velocity
of the base in its own axes where it floats. An answer is {poses, M, tau} per state, or {error}. The function
``answer`` of raw_ENGINE.py, beside this file, gives it.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from typing import Any


def main() -> None:
    engine, tasks, answers = sys.argv[1:]
    answer = import_module(f"raw_{engine}").answer

    def answer_or_error(task: dict[str, Any]) -> Any:
        try:
            return answer(task)
        except Exception as error:
            return {"error": f"{type(error).__name__}: {error}"}

    with open(tasks, encoding="utf-8") as file:
        given = json.load(file)
    with open(answers, "w", encoding="utf-8") as file:
        json.dump([answer_or_error(task) for task in given], file)


if __name__ == "__main__":
    main()
