"""Links from each step of the tutorial in the site to its program and its notebook, made by the build."""

from __future__ import annotations

from pathlib import Path

from sphinx.application import Sphinx
from tutorial.pages import STEPS, write


def setup(app: Sphinx) -> dict[str, object]:
    """Add the links to the pages, and the files to the site."""
    app.connect("source-read", add_links)
    app.connect("build-finished", write_files)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def add_links(app: Sphinx, page: str, source: list[str]) -> None:
    """Write the links below the title of a step."""
    name = page.removeprefix("tutorial/")
    if name in {path.stem for path in STEPS} and app.builder.format == "html":
        title, _, text = source[0].partition("\n")
        links = " or ".join(
            f'<a href="{name}.{suffix}" download>{kind}</a>'
            for kind, suffix in (("program", "py"), ("notebook", "ipynb"))
        )
        source[0] = f"{title}\n\n<p>Download this step as a {links}.</p>\n{text}"


def write_files(app: Sphinx, exception: Exception | None) -> None:
    """Write the programs and notebooks beside the pages."""
    if exception is None and app.builder.format == "html":
        write(Path(app.outdir) / "tutorial")
