"""Links in the place of files are refused where dynx chose the name."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from dynx.errors import ArgumentError
from dynx.files.links import refuse_links


@pytest.mark.skipif(sys.platform == "win32", reason="links need a right")
def test_links_under_names_of_dynx_are_refused_and_those_of_the_user_followed(tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    folder = tmp_path / "linked"
    folder.symlink_to(tmp_path, target_is_directory=True)  # The user names it.
    (tmp_path / "to_folder").symlink_to(outside, target_is_directory=True)
    (tmp_path / "to_file").symlink_to(outside / "new")
    (tmp_path / "own").mkdir()
    (tmp_path / "own" / "inner").symlink_to(tmp_path / "nowhere")
    refuse_links(folder, ["new", "own/new", "none/new", "outside"])
    for name in ("to_folder", "to_folder/a/b", "to_file", "own/inner", "own/inner/c"):
        with pytest.raises(ArgumentError, match=r"' is a link, through which dynx would write; remove it"):
            refuse_links(folder, ["new", name])
