"""Run of ``dynx contacts``: the measurement with its progress, then tables, files and the exit code."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial

from dynx.cli.contacts.document import ContactsDocument, document
from dynx.cli.contacts.page import contacts_page
from dynx.cli.contacts.tables import show
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, failure_of
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_json, check_writable
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.settings import settings_by_engine
from dynx.cli.shell.tables import Table
from dynx.cli.shell.terminal import command_line, console, counted, present
from dynx.contacts import STEPS, Conformance, conform, find_cases
from dynx.errors import ArgumentError
from dynx.files.writing import write_text
from dynx.world.registry import installed_worlds


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
        table = Table("case", "title")
        for case in chosen_cases:
            table.add_row(case.name, case.title)
        console().print(table)
        return DONE
    check_json(json_path)
    if html_path is not None:
        check_writable(html_path)
        if html_path == json_path:
            raise ArgumentError(f"two formats would be written to {html_path!r}")
    chosen = engines or installed_worlds()
    given = settings_by_engine(chosen, settings)
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
            complain(f"interrupted: {counted(found.not_done, 'trial')} not done")
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
    return NEGATIVE_RESULT if found.unexplained or found.failures else DONE
