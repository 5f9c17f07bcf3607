"""The page that the browser loads: viser's, and a script of dynx that runs before it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from html import escape
from pathlib import Path

from dynx.viewer.library import CLIENT

NAMES = "dynx-names"
"""Identifier of the element that holds the names of parts by the paths of their nodes, as JSON."""

HOVERED = "dynx-hovered"
"""Identifier of the element that shows the name of the part under the pointer."""

_FOR_SOFTWARE = """
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return context.call(this, kind, kind.startsWith("webgl") ? {...options, antialias: false} : options);
  };
  Object.defineProperty(window, "devicePixelRatio", {get: () => 2 / 3});
"""
"""Draws each pixel once instead of four times, which halves the time of a picture drawn by software, and lets
viser, which lowers the resolution by a quarter where pictures come slowly, lower it by half."""

# viser's page notes what the pointer is over, to outline it, and tells no program of it. Where a version of
# it keeps that note elsewhere, no name is shown.
_NAMES_ON_HOVER = (
    f"const NAMES = {json.dumps(NAMES)}, HOVERED = {json.dumps(HOVERED)};"
    + """
  const label = document.createElement("div");
  label.id = HOVERED;
  label.style.cssText = "position: fixed; z-index: 1000; pointer-events: none; display: none;"
    + "max-width: 20em; padding: 0.2em 0.5em; border-radius: 3px; font: 13px sans-serif;"
    + "overflow-wrap: anywhere;"
    + "color: white; background: rgba(0, 0, 0, 0.8)";
  let text = null, names = [];
  const hovered = () => {
    const page = window.__viserMutable, source = document.getElementById(NAMES)?.dataset.names;
    const under = page?.scene?.__r3f?.root?.getState?.().internal?.hovered;
    if (!source || !under?.size) return null;
    if (source !== text) names = Object.entries(JSON.parse(text = source));
    for (const {eventObject} of under.values()) {
      const found = names.find(([path]) => {
        const node = page.nodeRefFromName[path];
        return node && (node === eventObject || node.parent === eventObject);
      });
      if (found) return found[1];
    }
    return null;
  };
  // The page handles the event first.
  addEventListener("pointermove", (event) => setTimeout(() => {
    const name = event.pointerType === "touch" || event.buttons ? null : hovered();
    if (!label.parentNode) document.body.append(label);
    label.style.display = name === null ? "none" : "block";
    if (name === null) return;
    label.textContent = name;
    const left = event.clientX + 14, top = event.clientY + 18;
    label.style.left = Math.max(0, Math.min(left, innerWidth - label.offsetWidth)) + "px";
    label.style.top = Math.max(0, Math.min(top, innerHeight - label.offsetHeight)) + "px";
  }));
"""
)


class Client:
    """A folder with the page, for the time of a server."""

    def __init__(self, *, antialiasing: bool) -> None:
        """Without `antialiasing` edges are jagged, and software draws twice as fast."""
        self._folder = tempfile.TemporaryDirectory(prefix="dynx-page-", ignore_cleanup_errors=True)
        script = _NAMES_ON_HOVER if antialiasing else _FOR_SOFTWARE + _NAMES_ON_HOVER
        page = CLIENT.read_text(encoding="utf-8")
        head, end, rest = page.partition("</head>")
        text = f"{head}<script>(() => {{{script}}})();</script>{end}{rest}" if end else page
        (self.folder / "index.html").write_text(text, encoding="utf-8")

    @property
    def folder(self) -> Path:
        """The folder that is served."""
        return Path(self._folder.name)

    def remove(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


def names_element(names: Mapping[str, str]) -> str:
    """Return the HTML element by which the page knows the name of the part of each node."""
    return (
        f'<div id="{NAMES}" style="display: none" data-names="{escape(json.dumps(names), quote=True)}"></div>'
    )
