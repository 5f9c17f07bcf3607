"""Run of ``dynx contacts``: the measurement with its progress, then tables, files and the exit code."""

from __future__ import annotations

import textwrap
import time
from collections.abc import Sequence
from functools import partial

from rich.text import Text

from dynx.cli.contacts.document import ContactsDocument, document
from dynx.cli.contacts.page import contacts_page
from dynx.cli.contacts.tables import show
from dynx.cli.shell.exits import BAD_INPUT, DONE, INTERRUPTED, NEGATIVE_RESULT, complain, failure_of, one_line
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_json, check_writable
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.settings import settings_by_engine
from dynx.cli.shell.terminal import command_line, console, counted, present
from dynx.contacts import STEPS, Conformance, ContactCase, conform, find_cases
from dynx.contacts.candidates import SUBSTEPS
from dynx.errors import ArgumentError
from dynx.files.writing import write_text
from dynx.steppers.registry import installed_worlds
from dynx.steppers.settings import Setting


def contacts(
    engines: tuple[str, ...] | None,
    cases: tuple[str, ...] | None,
    steps: tuple[float, ...] | None,
    settings: Sequence[tuple[str, str]],
    jobs: int | None,
    only_list: bool,
    json_path: str | None,
    html_path: str | None,
    quiet: bool,
) -> int:
    """Measure the engines; return the exit code."""
    chosen_cases = find_cases(cases)
    if only_list:
        if json_path is not None or html_path is not None:
            raise ArgumentError("--list runs nothing, so that it has no results for --json and --html")
        _list_cases(chosen_cases)
        return DONE
    check_json(json_path)
    if html_path is not None:
        check_writable(html_path)
        if html_path == json_path:
            raise ArgumentError(f"two formats would be written to {html_path!r}")
    chosen = engines or installed_worlds()
    given = settings_by_engine(
        chosen, settings, {SUBSTEPS: Setting(1, "steps of the engine in each step", 1)}
    )
    started = time.perf_counter()
    with interruptible() as interruption:
        with progress_bar(len(chosen), enabled=not quiet) as advance:
            found = conform(
                chosen,
                steps or STEPS,
                chosen_cases,
                settings=given,
                jobs=jobs,
                progress=lambda done, total: advance(done, "measuring", total),
                interruptible=True,
            )
        interruption.finishing = True
        if found.not_done:
            how = "interrupted" if interruption.code in (None, INTERRUPTED) else "terminated"
            complain(f"{how}: {counted(found.not_done, 'trial')} not done")
        report = document(found, time.perf_counter() - started)
        code = _conclude(report, found, json_path, html_path, quiet=quiet, every_figure=cases is not None)
    return code if interruption.code is None else interruption.code


def _conclude(
    report: ContactsDocument,
    found: Conformance,
    json_path: str | None,
    html_path: str | None,
    *,
    quiet: bool,
    every_figure: bool,
) -> int:
    errors = []
    if html_path is not None:
        page = contacts_page(report, command=command_line())
        errors.append(failure_of(write_text, html_path, page))
    tables = (lambda *_: None) if quiet else partial(show, every_figure=every_figure)
    errors.append(present(report, tables, json_path))
    for error in errors:
        if error is not None:
            complain(str(error))
    if any(error is not None for error in errors):
        return BAD_INPUT
    if not found.results and not found.not_done:
        lost = (*found.failures, *found.refusals)
        complain("nothing was measured" + (f"; {lost[0].engine}: {lost[0].message}" if lost else ""))
        return NEGATIVE_RESULT
    return NEGATIVE_RESULT if found.unexplained or found.failures else DONE


def _list_cases(cases: Sequence[ContactCase]) -> None:
    """Print name and title of each case, and its law below."""
    out = console()
    for case in cases:
        out.print(Text.assemble((one_line(case.name), "bold"), f"  {one_line(case.title)}"))
        for line in textwrap.wrap(one_line(case.law), max(out.width - 4, 40), break_long_words=False):
            out.print(Text(f"    {line}"))
