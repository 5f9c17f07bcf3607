"""Pages of hostile files in headless Chromium without a network::

    python -m tests.viewer.hostile_pages

lets `dynx view --export` write the page of each file of `tests.security.surfaces.viewed_files`, opens what
it wrote, and prints what is wrong with the end of each command and with each page; exits with 1 if there is
anything.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.security.attack import ATTACKS, Attack
from tests.security.surfaces import viewed_files
from tests.security.surfaces.page import MARK
from tests.security.victims import attacked_together
from tests.viewer.conftest import BROWSERS, PATIENCE, SOFTWARE, Opened

VIEWED_FILES = [each for each in ATTACKS if each.prepare.__module__ == viewed_files.__name__]
"""Attacks by files that are viewed."""

RAN = f"window.{MARK} = () => {{ window.ran = 1; }};"
"""Script that lets a page tell that code of the attacker ran."""


def faults_of_page(browser: Any, page: Path) -> list[str]:
    """Open a page without a network, let the pointer pass over it, and return what is wrong with it."""
    context = browser.new_context(viewport={"width": 900, "height": 450}, offline=True)
    try:
        context.add_init_script(RAN)
        opened = Opened(context.new_page())
        opened.page.set_default_timeout(1e3 * PATIENCE)
        opened.page.on("dialog", lambda dialog: opened.errors.append(f"a dialog: {dialog.message}"))
        opened.page.on("download", lambda _: opened.errors.append("a download"))
        opened.go_to(page.as_uri())
        opened.page.wait_for_timeout(500.0)
        box = opened.page.locator("canvas[data-engine]").bounding_box()
        for share in (0.2, 0.4, 0.5, 0.6, 0.8):
            opened.page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + share * box["height"])
            opened.page.wait_for_timeout(50.0)
        ran = [frame.url for frame in opened.page.frames if frame.evaluate("window.ran") is not None]
        asked = [each for each in opened.requests if not each.startswith(("data:", "blob:", page.as_uri()))]
        found = [f"ran a script in {each[:200]}" for each in ran]
        found += [f"asked for {each[:200]}" for each in asked]
        return found + [f"error in the console: {each[:300]}" for each in opened.errors]
    finally:
        context.close()


def faults_of_files(browser: Any, files: Sequence[Attack], folder: Path) -> dict[str, list[str]]:
    """Write the pages of files in a folder and open them; return what is wrong by the names of the files."""
    found = attacked_together(list(files), folder)
    # The folder of each attack has its number.
    for number, attack in enumerate(files):
        page = folder / str(number) / "here" / "out.html"
        if page.exists():
            found[attack.key] += faults_of_page(browser, page)
    return found


def main() -> int:
    """Print what is wrong with each file."""
    from playwright.sync_api import sync_playwright

    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory(prefix="dynx-pages-") as folder:
        browser = playwright.chromium.launch(executable_path=program, args=list(SOFTWARE))
        found = faults_of_files(browser, VIEWED_FILES, Path(folder))
        pages = len(list(Path(folder).glob("*/here/out.html")))
        browser.close()
    for name, wrong in found.items():
        print(f"{'FAILS' if wrong else 'held '} {name}")
        for each in wrong:
            print(f"      {each}")
    print(f"{len(found)} files, {pages} pages opened, {sum(map(bool, found.values()))} not held")
    return 1 if any(found.values()) else 0


if __name__ == "__main__":
    sys.exit(main())
