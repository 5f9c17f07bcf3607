"""The causes of a robot on the page: how large, where, what to do, and the lines of the file."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from dynx.doctor.formats import wording
from dynx.doctor.formats.causes import Cause
from dynx.doctor.formats.html_changes import excerpt
from dynx.doctor.formats.html_elements import code, escape, folded, name, pre
from dynx.doctor.report import DoctorReport, Finding, Unexplained

_OPEN_PLACES = 2
"""Places of a cause that are seen at once."""

_SHOWN_PLACES = 40
"""Places of a cause on the page at all."""

_SCALE = (-16, 0)
"""The bar of sizes runs from 1e-16, the last digit of a double, to 100 %, where it is full."""


def cause_card(cause: Cause, report: DoctorReport) -> str:
    """One cause."""
    shown = cause.findings[:_SHOWN_PLACES]
    # Where nothing differs one look at the file is enough.
    looks = len(shown) if cause.worst is not None else 1
    places = [_place(each, report, look=number < looks) for number, each in enumerate(shown)]
    parts = [
        f'<div class="head"><h4>{code(cause.rule)} {name(cause.name)}</h4>{_size(cause)}'
        f"{''.join(_tag(engine) for engine in cause.engines)}</div>",
        _bar(cause, report.tolerance),
        f"<p>{escape(cause.title)}</p>",
        f'<p class="todo">{escape(cause.advice)}</p>' if cause.advice else "",
        *(f'<p class="faint">Mended: {escape(remedy)}.</p>' for remedy in cause.remedies),
        _places(places[:_OPEN_PLACES]),
    ]
    if len(cause.findings) > _OPEN_PLACES:
        rest = len(cause.findings) - _SHOWN_PLACES
        more = f'<p class="faint">and {rest} more: see the JSON document.</p>' if rest > 0 else ""
        summary = f"{len(cause.findings) - _OPEN_PLACES} more"
        parts.append(folded(escape(summary), _places(places[_OPEN_PLACES:]) + more))
    if cause.entry is not None:
        parts.append(f'<p><a href="#{rule_anchor(cause)}">About this rule</a></p>')
    return f'<article class="cause {cause.severity}">\n' + "\n".join(filter(None, parts)) + "\n</article>"


def rule_pages(found: Iterable[Cause]) -> str:
    """The pages of the catalogue for these causes, each once, folded."""
    pages = {cause.rule: cause for cause in found if cause.entry is not None}
    parts = []
    for rule in sorted(pages):
        cause = pages[rule]
        assert cause.entry is not None
        # What a link points to lies within, for then browsers unfold it.
        page = f'<div id="{rule_anchor(cause)}">{pre(cause.entry.page())}</div>'
        parts.append(folded(f"{code(rule)} {name(cause.name)}", page, css="rule"))
    return "\n".join(parts)


def rule_anchor(cause: Cause) -> str:
    """The ``id`` of a rule's page; rules of the catalogue have plain names."""
    return f"rule-{cause.rule.lower()}"


def unexplained_card(each: Unexplained) -> str:
    """One difference that no rule accounts for, with the smallest robot that shows it."""
    where = "" if each.joint is None else f", worst at joint {code(each.joint)}"
    parts = [
        f'<div class="head"><h4>{escape(wording.quantity(each.quantity))} of {name(each.engine)}</h4>'
        f'<span class="size">off by {escape(wording.size(each.relative_error))}{where}</span></div>'
    ]
    found = each.counterexample
    if found is not None:
        state = "\n".join(
            f"{symbol} = {list(values)}"
            for symbol, values in (("q", found.q), ("v", found.v), ("a", found.a))
        )
        joints = f"{found.moving_joints} moving {'joint' if found.moving_joints == 1 else 'joints'}"
        said = f"The smallest robot that shows it: {joints}, off by {wording.size(found.relative_error)}"
        parts.append(folded(escape(said), pre(state) + pre(found.urdf)))
    return '<article class="cause error">\n' + "\n".join(parts) + "\n</article>"


def _size(cause: Cause) -> str:
    said = (
        wording.effect(cause.worst)
        if cause.worst is not None or cause.kind == "difference"
        else "bad practice"
    )
    if cause.severity == "warning":
        said += " (rounding)"
    if cause.worst is not None:
        said += ", proved" if cause.proved else ", not proved"
    return f'<span class="size">{escape(said)}</span>'


def _tag(engine: str) -> str:
    return f'<span class="tag">{name(engine)}</span>'


def _bar(cause: Cause, tolerance: float) -> str:
    """The size on a logarithmic scale, with a mark at the tolerance."""
    if cause.worst is None:
        return ""
    width = _share(cause.worst.relative_error)
    mark = f'<b style="left:{_share(tolerance):.1f}%"></b>' if tolerance > 0.0 else ""
    label = f"relative error {wording.relative(cause.worst.relative_error)}, tolerance {tolerance:g}"
    scale = "".join(f"<span>{text}</span>" for text in ("1e-16", "1e-8", "100 %"))
    return (
        f'<div class="bar" role="img" aria-label="{escape(label)}" title="{escape(label)}">'
        f'<i style="width:{width:.1f}%"></i>{mark}</div><div class="scale" aria-hidden="true">{scale}</div>'
    )


def _share(error: float) -> float:
    """Where on the bar an error is, in per cent; what is no number fills it."""
    if not math.isfinite(error):
        return 100.0
    low, high = _SCALE
    return 100.0 * (min(max(math.log10(max(error, 10.0**low)), low), high) - low) / (high - low)


def _places(places: Sequence[str]) -> str:
    return f'<ul class="places">{"".join(places)}</ul>' if places else ""


def _place(finding: Finding, report: DoctorReport, *, look: bool) -> str:
    line = "" if finding.line is None else f", line {finding.line}"
    effect = "" if finding.effect is None else f" ({escape(wording.effect(finding.effect))})"
    return (
        f"<li><strong>{escape(wording.part(finding))}</strong>{line}: {name(finding.message, 600)}{effect}"
        f"{excerpt(report, finding.line) if look else ''}</li>"
    )
