"""The page that the browser loads: viser's, and a script of dynx that runs before it."""

from __future__ import annotations

import json
import tempfile
from base64 import b64encode
from collections.abc import Mapping
from hashlib import sha256
from html import escape
from pathlib import Path
from typing import Any

from dynx.viewer.browser.access import ContentPolicy
from dynx.viewer.library import CLIENT

NAMES = "dynx-names"
"""Identifier of the element that holds the names of parts by the paths of their nodes, as JSON."""

HOVERED = "dynx-hovered"
"""Identifier of the element that shows the name of the part under the pointer."""

NO_SOFTWARE_MESSAGE = "#webgl-software-rendering { display: none; }"
"""Style that hides the message of viser that software draws."""

_LEGEND_STYLE = (
    "position: fixed; left: 0.5em; top: 0.5em; max-width: 20em; padding: 0.1em; border-radius: 3px; "
    "font-family: sans-serif; color: black; background: rgba(255, 255, 255, 0.8)"
)
"""Style of the legend, which is read before any picture."""

_FOR_SOFTWARE = """
  const context = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    return context.call(this, kind, kind.startsWith("webgl") ? {...options, antialias: false} : options);
  };
  const whole = window.devicePixelRatio, ratio = 2 / 3;
  Object.defineProperty(window, "devicePixelRatio", {get: () => ratio});
  // Plots, whose canvas is small and has letters, keep the resolution.
  for (const side of ["width", "height"]) {
    const given = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, side);
    Object.defineProperty(HTMLCanvasElement.prototype, side, {...given, set(pixels) {
      const factor = this.parentNode?.className === "u-wrap" ? whole / ratio : 1;
      given.set.call(this, Math.round(factor * pixels));
      if (factor !== 1) this.getContext("2d").setTransform(factor, 0, 0, factor, 0, 0);
    }});
  }
"""
"""Draws each pixel once instead of four times, which halves the time of a picture drawn by software, and lets
viser, which lowers the resolution by a quarter where pictures come slowly, lower it by half."""

_SCRIPTS_OF_SCRIPTS = """
  const create = document.createElement;
  document.createElement = function (name, ...options) {
    const made = create.call(this, name, ...options);
    if (String(name).toLowerCase() === "script") made.nonce = %s;
    return made;
  };
"""
"""Lets the page, whose code is compressed, create its own script under its content security policy."""

_PRESSES = """
  const listen = EventTarget.prototype.addEventListener;
  EventTarget.prototype.addEventListener = function (kind, listener, options) {
    const given = kind === "pointerdown" && options?.passive ? {...options, passive: false} : options;
    return listen.call(this, kind, listener, given);
  };
"""
"""Lets viser prevent the default of a press on a part that is dragged: react-three-fiber listens passively,
and a browser then reports an error."""

# A program is not told what the pointer is over. Where a version of viser keeps its scene elsewhere, no name
# is shown.
_NAMES_ON_HOVER = (
    f"const NAMES = {json.dumps(NAMES)}, HOVERED = {json.dumps(HOVERED)};"
    + """
  const label = document.createElement("div");
  label.id = HOVERED;
  label.style.cssText = "position: fixed; z-index: 1000; pointer-events: none; display: none;"
    + "max-width: 20em; padding: 0.2em 0.5em; border-radius: 3px; font: 13px sans-serif;"
    + "overflow-wrap: anywhere;"
    + "color: white; background: rgba(0, 0, 0, 0.8)";
  let text = null, names = [], latest = null;
  const hovered = (event) => {
    const page = window.__viserMutable, source = document.getElementById(NAMES)?.dataset.names;
    const picture = page?.scene?.__r3f?.root?.getState?.();
    if (!picture || !source) return null;
    const canvas = picture.gl.domElement, box = canvas.getBoundingClientRect();
    if (!canvas.parentNode.contains(event.target)) return null;
    if (source !== text) names = Object.entries(JSON.parse(text = source));
    const parts = new Map(names.map(([path, name]) => [page.nodeRefFromName[path], name]));
    const drawn = new Map();
    const visit = (object, part) => {
      if (!object.visible) return;
      part = parts.get(object) ?? part;
      if (part !== undefined && object.isMesh) drawn.set(object, part);
      for (const below of object.children) visit(below, part);
    };
    visit(picture.scene, undefined);
    const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
    picture.raycaster.setFromCamera({x: 2 * x - 1, y: 1 - 2 * y}, picture.camera);
    const [first] = picture.raycaster.intersectObjects([...drawn.keys()], false);
    return first ? drawn.get(first.object) : null;
  };
  const show = () => {
    const event = latest;
    latest = null;
    const name = event.pointerType === "touch" || event.buttons ? null : hovered(event);
    if (!label.parentNode) document.body.append(label);
    label.style.display = name === null ? "none" : "block";
    if (name === null) return;
    label.textContent = name;
    const left = event.clientX + 14, top = event.clientY + 18;
    label.style.left = Math.max(0, Math.min(left, innerWidth - label.offsetWidth)) + "px";
    label.style.top = Math.max(0, Math.min(top, innerHeight - label.offsetHeight)) + "px";
  };
  addEventListener("pointermove", (event) => {
    if (latest === null) requestAnimationFrame(show);
    latest = event;
  });
"""
)


class Client:
    """A folder with the page, for the time of a server."""

    def __init__(self, title: str, *, antialiasing: bool) -> None:
        """Without `antialiasing` edges are jagged, and software draws twice as fast."""
        self._folder = tempfile.TemporaryDirectory(prefix="dynx-page-", ignore_cleanup_errors=True)
        script = _PRESSES + _NAMES_ON_HOVER if antialiasing else _FOR_SOFTWARE + _PRESSES + _NAMES_ON_HOVER
        policy = ContentPolicy("'self' data: blob:")
        self.headers = tuple(policy.headers([HANDLER_HASH]))
        """Headers with which the page is served."""
        self._text = _guarded(CLIENT.read_text(encoding="utf-8"), script, policy)
        self.entitle(title)

    def entitle(self, title: str) -> None:
        """Give the page another title, which its tab shows when it is loaded."""
        (self.folder / "index.html").write_text(_with_title(self._text, title), encoding="utf-8")

    @property
    def folder(self) -> Path:
        """The folder that is served."""
        return Path(self._folder.name)

    def remove(self) -> None:
        """Remove the folder."""
        self._folder.cleanup()


def names_element(names: Mapping[str, str]) -> str:
    """Return the HTML element by which the page knows the names of parts by the paths of their nodes."""
    return (
        f'<div id="{NAMES}" style="display: none" data-names="{escape(json.dumps(names), quote=True)}"></div>'
    )


def standalone(
    page: str, title: str, names: Mapping[str, str], *, legend: str = "", software: bool = False
) -> str:
    """Return a page of viser's that needs no server, with a title, the names of parts by the paths of their
    nodes, and HTML that is laid over the corner of the picture.

    With `software` the page does not say that software draws it: its meshes were reduced for that.
    """
    policy = ContentPolicy("data: blob:")
    page = _guarded(page, _NAMES_ON_HOVER, policy)
    meta = f'<meta http-equiv="Content-Security-Policy" content="{escape(policy.text(), quote=True)}">'
    page = page.replace("<head>", f"<head>{meta}", 1)
    body = page.rfind("</body>")
    if body < 0:
        return page
    added = names_element(names)
    if legend:
        added += f'<div style="{_LEGEND_STYLE}">{legend}</div>'
    if software:
        added += f"<style>{NO_SOFTWARE_MESSAGE}</style>"
    return _with_title(f"{page[:body]}{added}{page[body:]}", title)


def _with_title(page: str, title: str) -> str:
    """Return a page of viser's with another title."""
    return page.replace("<title>Viser</title>", f"<title>{escape(title)}</title>", 1)


def _guarded(page: str, script: str, policy: ContentPolicy) -> str:
    """Return a page of viser's, which has no text of a robot yet, with a script that runs before its own, and
    the nonce of a policy at every script."""
    nonce = json.dumps(policy.nonce)
    first = _SCRIPTS_OF_SCRIPTS % nonce + script
    page = page.replace("<script", f"<script nonce={nonce}")
    head, start, rest = page.partition("<script")
    return f"{head}<script nonce={nonce}>(() => {{{first}}})();</script>{start}{rest}"


_COPY = (
    "const b = this, t = b.dataset.text;"
    "const done = () => { b.textContent = 'copied'; setTimeout(() => { b.textContent = b.title; }, 1500); };"
    # A page from another machine has no clipboard unless it is encrypted; a selection is copied there.
    "const select = () => { const a = document.createElement('textarea'); a.value = t; b.after(a);"
    " a.select(); document.execCommand('copy'); a.remove(); done(); };"
    "navigator.clipboard ? navigator.clipboard.writeText(t).then(done, select) : select();"
)
"""Action of the button. The text is data of the button, never part of a script."""

HANDLER_HASH = f"sha256-{b64encode(sha256(_COPY.encode()).digest()).decode()}"
"""Hash of the action, by which the content security policy of the page lets it run."""

_LOOK = (
    "display: block; box-sizing: border-box; width: calc(100% - 1.6em); margin: 0.4em 0.8em; height: 2em; "
    "border: 0; border-radius: 2px; cursor: pointer; font-size: 0.8em; color: white; "
    "background: var(--mantine-primary-color-filled)"
)


class CopyButton:
    """A button with a label, and the text that it copies."""

    def __init__(self, gui: Any, label: str) -> None:
        self._label = label
        self._node = gui.add_html(self._html(""))

    def put(self, text: str) -> None:
        """Set the text that is copied."""
        self._node.content = self._html(text)

    def _html(self, text: str) -> str:
        label, data = escape(self._label, quote=True), escape(text, quote=True)
        return (
            f'<button type="button" title="{label}" data-text="{data}" style="{_LOOK}" '
            f'onclick="{escape(_COPY, quote=True)}">{label}</button>'
        )
