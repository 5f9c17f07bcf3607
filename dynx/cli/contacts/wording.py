"""Wording of verdicts, settings and numbers of the document of ``dynx contacts``, for screen and page."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from dynx.cli.shell.output import Entry

RANKS = ("within", "falls", "cannot", "setting", "unexplained")
"""Verdicts in ascending order of how much they deserve a look."""

VERDICT_MEANINGS = {
    "within": "the error is within the tolerance at every time step",
    "falls": "the error falls when the time step becomes shorter",
    "setting": (
        "the error stays. A setting of the engine is the cause: a run with another value of the setting "
        "shows this"
    ),
    "cannot": "the exact value needs a parameter that the engine does not have",
    "unexplained": "the error stays, and no setting that dynx tries is its cause",
}

SINGLE_STEP = (
    "measured at a single step: no error can be judged as falling with it; --dt with several steps shows "
    "which do"
)
"""Note on a run without a second step."""

PAIR_CASES = ("friction_pairs", "restitution_pairs")
"""Cases whose measured values are the effective coefficients of two materials."""

MAX_ORDER = 9.0
"""Largest order that is written as a number: above it the error is gone from one step to the next."""


def worst_figure(figures: Sequence[Entry]) -> Entry:
    """Return the figure that deserves the first look: by verdict, then by the error at the smallest step."""
    return max(figures, key=lambda each: (RANKS.index(each["verdict"]), last_error(each) / each["tolerance"]))


def last_error(figure: Entry) -> float:
    """Return the error at the smallest step; infinity where it is not finite."""
    return as_number(figure["errors"][-1])


def span_text(errors: Sequence[float | None]) -> str:
    """Write the errors at the largest and at the smallest step."""
    first, last = error_text(errors[0]), error_text(errors[-1])
    return f"{first} .. {last}" if len(errors) > 1 else last


def headline(counts: Mapping[str, int]) -> str:
    """Write how many errors are explained, and how."""
    if counts["unexplained"]:
        return f"{counts['unexplained']} of {sum(counts.values())} errors are unexplained."
    causes = [
        f"{counts[verdict]} {words}"
        for verdict, words in (
            ("within", "within the tolerance"),
            ("falls", "that fall with the step"),
            ("setting", "with a setting as the cause"),
            ("cannot", "that the engine cannot avoid, because it lacks a coefficient"),
        )
        if counts[verdict]
    ]
    return f"No error is unexplained: {', '.join(causes) or 'there are none'}."


def figures_by_name(case: Entry) -> dict[str, dict[str, Entry]]:
    """Return the figures of a case by name and engine."""
    found: dict[str, dict[str, Entry]] = {}
    for each in case["figures"]:
        found.setdefault(figure_name(each), {})[each["engine"]] = each
    return found


def as_number(value: float | None) -> float:
    """Return an error of a document, in which null stands for a number that is not finite."""
    return math.inf if value is None or not math.isfinite(value) else value


def error_text(value: float | None) -> str:
    """Write a relative error with two digits."""
    number = as_number(value)
    if number == math.inf:
        return "not finite"
    return "0" if number == 0.0 else f"{number:.1e}"


def figure_name(figure: Entry) -> str:
    """Write the name of a figure with that of its trial."""
    return ", ".join(part for part in (figure["figure"], figure["trial"]) if part)


def quantity_text(value: float | None, unit: str) -> str:
    """Write a measured or exact value with its unit."""
    number = as_number(value)
    text = "not finite" if number == math.inf else f"{number:.6g}"
    return f"{text} {unit}" if unit else text


def exact_text(figure: Entry) -> str:
    """Write the exact value of a figure with its unit, or the bounds that mechanics gives."""
    if figure["most"] is None:
        return quantity_text(figure["exact"], figure["unit"])
    return f"{quantity_text(figure['exact'], '')} .. {quantity_text(figure['most'], figure['unit'])}"


def measured_text(figure: Entry) -> str:
    """Write what was measured at the largest and at the smallest step."""
    first, last = (quantity_text(figure["measured"][k], figure["unit"]) for k in (0, -1))
    return last if len(figure["measured"]) == 1 else f"{first} .. {last}"


def coefficient_text(value: float | None) -> str:
    """Write a coefficient of friction or restitution."""
    number = as_number(value)
    return "not finite" if number == math.inf else f"{abs(number) if abs(number) < 5e-5 else number:.4f}"


def step_text(dt: float) -> str:
    """Write a step in milliseconds, or as the part of a second that it is."""
    milliseconds = 1e3 * dt
    if math.isclose(milliseconds, round(milliseconds, 3), rel_tol=1e-9):
        return f"{milliseconds:g} ms"
    part = 1.0 / dt
    return f"1/{part:.0f} s" if math.isclose(part, round(part), rel_tol=1e-9) else f"{milliseconds:.4g} ms"


def steps_text(steps: Sequence[float]) -> str:
    """Write the steps, largest first."""
    return ", ".join(step_text(each) for each in steps)


def order_text(order: float) -> str:
    """Write the order of an error."""
    return f"order {order:.1f}" if order <= MAX_ORDER else f"order above {MAX_ORDER:g}"


def change_text(settings: Mapping[str, Sequence[Any]], *, arrow: str = "->") -> str:
    """Write settings that change, with the value in use and the last one tried; of lists the numbers that
    change."""
    parts = []
    for name, values in settings.items():
        before, after = values[0], values[-1]
        if before == after:
            continue
        if isinstance(before, list):
            changed = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
            before, after = ([value[k] for k in changed] for value in (before, after))
        parts.append(f"{name} {_value(before)} {arrow} {_value(after)}")
    return ", ".join(parts)


def verdict_text(figure: Entry) -> str:
    """Write the verdict on a figure with what proves it; under bounds also what was measured."""
    text = _verdict_text(figure)
    if figure["most"] is None:
        return text
    return f"{text}; measured {measured_text(figure)}, bounds {exact_text(figure)}"


def _verdict_text(figure: Entry) -> str:
    verdict: str = figure["verdict"]
    if verdict == "falls":
        return f"falls with the step ({order_text(figure['order'])})"
    if verdict == "setting":
        return setting_text(figure["attribution"])
    if verdict == "cannot":
        return f"cannot: {figure['reason']}"
    return "within the tolerance" if verdict == "within" else verdict


def setting_text(attribution: Entry) -> str:
    """Write the change of settings that is the cause of an error, what is left of it, and the price."""
    left = span_text(attribution["errors"][-1])
    text = f"{change_text(attribution['settings'])}: {outcome_text(attribution)}, {left}"
    if attribution["price"]:
        text += f"; at the price of {price_text(attribution['price'])}"
    return text


def outcome_text(attribution: Entry) -> str:
    """Write what a change of settings does to an error."""
    if attribution["outcome"] == "removed":
        return "removed"
    what = "step" if attribution["outcome"] == "falls" else "setting"
    return f"falls with the {what} ({order_text(attribution['order'])})"


def price_text(price: Sequence[Entry]) -> str:
    """Write the error that a change makes worse by most, and the number of others."""
    worst = max(price, key=lambda each: as_number(each["after"]))
    text = f"{figure_name(worst)}, {error_text(worst['before'])} -> {error_text(worst['after'])}"
    return f"{text}, and {len(price) - 1} more" if len(price) > 1 else text


def _value(value: Any) -> str:
    if isinstance(value, list):
        return " ".join(map(_value, value))
    return f"{value:g}" if isinstance(value, float) else str(value)
