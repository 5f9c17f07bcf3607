"""How far one engine is from the right answer in one quantity at one state: what counterexamples keep."""

from __future__ import annotations

import numpy as np

from dynx.doctor.counterexample.trials import Difference
from dynx.doctor.examine.examination import Laboratory
from dynx.doctor.examine.right_answers import States, find_truth, free_model
from dynx.errors import DynxError
from dynx.model import Model
from dynx.rules.case import Case
from dynx.spatial.scalar import Floats


def difference_of(laboratory: Laboratory, engine: str, quantity: str) -> Difference:
    """The relative error of `engine` in `quantity` when it loads the text of a case."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        try:
            free = free_model(case.source, case.base)
            if (free.nq, free.nv) != (len(q), len(v)):
                return 0.0
            rows = [np.asarray(row, dtype=np.float64)[None] for row in (q, v, a)]
            truth = find_truth(free, States(rows[0], rows[1], rows[2], np.zeros_like(rows[2])))
            examination = laboratory.examine(case, [engine], truth=truth)
        except DynxError:
            return 0.0
        answers = examination.answers[engine]
        if answers.refused is not None or quantity in answers.failed:
            return 0.0
        return examination.error(engine, quantity)

    return difference
