"""One robot on the page: verdict, causes, measurements, what engines hold, what was changed."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.doctor.formats.baseline import Baseline
from dynx.doctor.formats.causes import causes, status
from dynx.doctor.formats.html_causes import cause_card, unexplained_card
from dynx.doctor.formats.html_changes import changes
from dynx.doctor.formats.html_elements import escape, folded, name, pre
from dynx.doctor.formats.html_heat import engine_map, joint_map, legend, pair_map
from dynx.doctor.formats.html_model import model_tables
from dynx.doctor.report import DoctorReport


def robot_section(report: DoctorReport, baseline: Baseline | None) -> str:
    """Everything about one report, without its title."""
    where = "" if report.source is None else f'<p class="path">{name(report.source, 500)}</p>'
    verdict = f'<p class="verdict {status(report)}">{name(_sentence(report), 2000)}</p>'
    if report.error is not None:
        return where + verdict
    found = causes(report)
    effective = [cause_card(each, report) for each in found if each.worst is not None]
    harmless = [
        cause_card(each, report) for each in found if each.worst is None and each.kind == "difference"
    ]
    practice = [cause_card(each, report) for each in found if each.worst is None and each.kind == "practice"]
    changed = changes(report)
    parts = [
        where,
        verdict,
        _known(report, baseline),
        _part("Unexplained", [unexplained_card(each) for each in report.unexplained]),
        _part("Causes", effective),
        _part(
            "Error against what the file says",
            [legend(report.tolerance), engine_map(report) + _referee(report)],
        ),
        _part("Engine against engine, as loaded", [pair_map(report)]),
        _part("Joint by joint, as loaded", [joint_map(report)]),
        _part("What engines hold that the file does not say", [model_tables(report)]),
        _part("What mending changes", [changed]),
        _part("Decided where the file is ambiguous", [_listed(report.choices)]),
        _part(
            "What no URDF can mend: to be called after loading",
            [f"<p>{name(call.engine)}</p>{pre(call.code)}" for call in report.calls],
        ),
        _part("Present, without effect on this base", harmless),
        _part("Bad practice", practice),
        _part("How each engine loaded the file", [_calls(report)]),
    ]
    return "\n".join(filter(None, parts))


def robot_summary(report: DoctorReport, called: str, identity: str, baseline: Baseline | None) -> str:
    """A robot of many: folded, with its verdict in the line that opens it."""
    word = status(report)
    title = f"<h2>{escape(called)}, {escape(report.base)} base</h2>"
    line = f'{title} <span class="tag {word}">{word}</span>'
    # What a link points to lies within, for then browsers unfold it.
    content = f'<div id="{identity}">{robot_section(report, baseline)}</div>'
    return folded(line, content, css="robot")


def _referee(report: DoctorReport) -> str:
    """How good the answers are that engines are measured by."""
    if not report.referee:
        return ""
    said = f"What the file says is known to {report.referee:.0e}, by a computation in 50 digits."
    return f'<p class="faint">{escape(said)}</p>'


def _sentence(report: DoctorReport) -> str:
    said = report.verdict
    return said[:1].upper() + said[1:]


def _part(title: str, contents: Sequence[str]) -> str:
    inside = "\n".join(filter(None, contents))
    # A legend alone explains nothing.
    return f"<h3>{escape(title)}</h3>\n{inside}" if any(contents) and contents[-1] else ""


def _listed(items: Sequence[str]) -> str:
    return f"<ul>{''.join(f'<li>{name(item, 1000)}</li>' for item in items)}</ul>" if items else ""


def _known(report: DoctorReport, baseline: Baseline | None) -> str:
    if baseline is None:
        return ""
    found = baseline.compare(report)
    counts = f"{len(found.new)} new, {len(found.known)} known, {len(found.vanished)} gone"
    parts = [f"<p>Against the baseline: {counts}.</p>"]
    for word, group in (("New", found.new), ("Gone", found.vanished)):
        if group:
            items = [f"{each.place} ({', '.join(sorted(each.engines))})" for each in group]
            parts.append(folded(escape(word), _listed(items), opened=word == "New"))
    return "\n".join(parts)


def _calls(report: DoctorReport) -> str:
    entries = []
    for each in report.engines:
        refused = "" if each.refused is None else f"<p>Refuses the file: {name(each.refused, 1000)}</p>"
        after = ""
        if each.refused is not None and report.mended is not None:
            after = "<p>It loads the mended file.</p>" if each.refused_after is None else ""
            after = after or f"<p>It refuses the mended file too: {name(each.refused_after, 1000)}</p>"
        title = f"<dt>{name(each.engine)} {name(each.version)}</dt>"
        entries.append(f"{title}<dd>{pre(each.call)}{refused}{after}</dd>")
    return f"<dl>{''.join(entries)}</dl>" if entries else ""
