"""Access to the page, its script in the browser, and the messages that it sends.

A web page from anywhere can open a socket to this machine, and a name of its own that resolves to 127.0.0.1
makes it the same origin (DNS rebinding). So every request needs the token, which only the address of the page
has, names a host of this machine, and comes from the page itself.

viser sets what a message names, so that a value of another type, or a property other than the value, would
break a control for every page. Such messages are dropped.
"""

from __future__ import annotations

import ipaddress
import json
import math
import re
import secrets
import socket
import types
from base64 import b64encode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import cache
from hashlib import sha256
from html import escape
from http import HTTPStatus
from typing import Any, Literal, NamedTuple, Union, get_args, get_origin, get_type_hints

from dynx.files.temporary import temporary_folder, writing_in
from dynx.viewer.first_picture import FIRST_PICTURE
from dynx.viewer.library import CLIENT
from dynx.viewer.moving_picture import ALWAYS_WHOLE, COARSE_WHILE_MOVING
from dynx.viewer.occlusion import NO_OCCLUSION, OCCLUSION
from dynx.viewer.pose_channel import PLACING
from dynx.viewer.shading import SHADOWS
from dynx.viewer.surroundings import SURROUNDINGS
from dynx.world.scenery import ROUGHNESS

LOOPBACK_NAMES = ("localhost", "127.0.0.1", "::1")

TOKEN_BYTES = 18
"""Length of the token, beyond what anybody can try [bytes]."""


def is_loopback(host: str) -> bool:
    """Check whether an address to listen on is reached from this machine alone."""
    if host in LOOPBACK_NAMES:
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


_HOST = re.compile(r"(\[[0-9a-f:.]+\]|[^@:/?#\\\[\]%,\s]+)(?::\d+)?")
"""A host as a browser writes it: a name or an address, and perhaps a port."""


class Access:
    """What may use a page: requests for ``/TOKEN/``, for a host of this machine, from the page itself."""

    def __init__(self, host: str) -> None:
        """`host` is the address that the page listens on."""
        self.token = secrets.token_urlsafe(TOKEN_BYTES)
        """Secret part of the address of the page."""
        self._names = {host.lower(), *LOOPBACK_NAMES}
        self._any_address = not is_loopback(host)
        if self._any_address:
            name = socket.gethostname().lower()
            self._names |= {name, f"{name}.local"}

    def path_below(self, path: str) -> str | None:
        """Return the path of a request below the token, such as ``/``; None for one without the token."""
        given, slash, rest = path.partition("?")[0].removeprefix("/").partition("/")
        if not secrets.compare_digest(given.encode(), self.token.encode()):
            return None
        return f"/{rest}" if slash else "/"

    def is_ours(self, hosts: Sequence[str], origins: Sequence[str]) -> bool:
        """Check the headers Host and Origin of a request: a host of this machine, and its origin or none."""
        if len(hosts) != 1 or len(origins) > 1:
            return False
        host = hosts[0].strip().lower()
        if not self._is_known(host):
            return False
        return all(each.strip().lower() == f"http://{host}" for each in origins)

    def guard(self, answer: Any, headers: Sequence[tuple[str, str]]) -> Any:
        """Return a function that answers requests of the page as `answer` does, with `headers` added, and
        refuses every other request."""

        def guarded(connection: Any, request: Any) -> Any:
            path = self.path_below(request.path)
            given = request.headers
            if path is None or not self.is_ours(given.get_all("Host"), given.get_all("Origin")):
                return connection.respond(
                    HTTPStatus.FORBIDDEN, "wanted the address of the page, with its token\n"
                )
            request.path = path
            response = answer(connection, request)
            for name, value in headers if response is not None else ():
                response.headers[name] = value
            return response

        return guarded

    def _is_known(self, host: str) -> bool:
        written = _HOST.fullmatch(host)
        if written is None:
            return False
        name = written[1].strip("[]")
        if name in self._names:
            return True
        try:
            address = ipaddress.ip_address(name)
        except ValueError:
            return False
        # A page cannot have an address for its name, unless it comes from there.
        return self._any_address or address.is_loopback


_FRAMES = "'self' http://127.0.0.1:* http://localhost:* vscode-webview:"
"""Sites that may show a page in a frame: notebooks and editors of this machine."""


class ContentPolicy:
    """Content security policy of a page: its own scripts alone run, and it reaches nothing else.

    A script of the page has the nonce, which is new for every page; text of a robot cannot have it.
    """

    def __init__(self, connect: str) -> None:
        """`connect` is what the page may fetch, as sources of a policy."""
        self.nonce = secrets.token_urlsafe(TOKEN_BYTES)
        self._connect = connect

    def text(self, handlers: Sequence[str] = ()) -> str:
        """Return the policy; `handlers` are the hashes of handlers that stand in HTML."""
        # The bindings of viser's WebAssembly compile text with Function.
        scripts = [f"'nonce-{self.nonce}'", "'unsafe-eval'", "blob:"]
        if handlers:
            scripts += ["'unsafe-hashes'", *(f"'{each}'" for each in handlers)]
        directives: Mapping[str, str] = {
            "default-src": "'none'",
            "script-src": " ".join(scripts),
            "style-src": "'unsafe-inline'",
            "img-src": "data: blob:",
            "font-src": "data: blob:",
            "media-src": "data: blob:",
            "worker-src": "blob:",
            "connect-src": self._connect,
            "base-uri": "'none'",
            "form-action": "'none'",
        }
        return "; ".join(f"{name} {value}" for name, value in directives.items())

    def headers(self, handlers: Sequence[str]) -> Iterator[tuple[str, str]]:
        """Yield the headers of a page with this policy."""
        # In a page's own text this directive has no effect.
        yield "Content-Security-Policy", f"{self.text(handlers)}; frame-ancestors {_FRAMES}"
        yield "Referrer-Policy", "no-referrer"
        yield "X-Content-Type-Options", "nosniff"
        yield "Cross-Origin-Resource-Policy", "same-origin"
        yield "Cache-Control", "no-store"


MAX_TEXT = 100_000
"""Largest length of a text in a message [characters]."""

MAX_NUMBER = 1e12
"""Largest magnitude of a number in a message."""

_DROPPED = ("ShareUrlRequest", "ShareUrlDisconnect")
"""Messages that are never passed on: they publish the page through a server of viser's."""

_UPDATE = "GuiUpdateMessage"
"""Message that changes a control."""


class CheckedMessages:
    """Messages of viser as they are received: valid ones, and None instead of any other."""

    def __init__(self, messages: Any, control: Callable[[str], Any]) -> None:
        """`messages` is viser's class of messages, `control(uuid)` returns a control of the page or None."""
        self._messages = messages
        self._control = control

    def deserialize(self, raw: bytes) -> Any:
        """Return the message of its bytes; None, which nothing handles, for one that is not valid."""
        try:
            message = self._messages.deserialize(raw)
        except Exception:  # anything can be in the bytes
            return None
        kind: Any = type(message)
        if kind.__name__ in _DROPPED:
            return None
        hints = _hints(kind)
        values = {name: getattr(message, name) for name in hints if hasattr(message, name)}
        if not all(fits(value, hints[name]) for name, value in values.items()):
            return None
        if "wxyz" in values and not any(values["wxyz"]):
            return None
        if kind.__name__ == _UPDATE:
            return message if self._is_change_of_value(message) else None
        return message

    def _is_change_of_value(self, message: Any) -> bool:
        """Check that a message gives a control a value that it may have; numbers are clamped to its range."""
        control = self._control(message.uuid)
        if set(message.updates) != {"value"} or control is None:
            return False
        present, props = control.value, getattr(control, "props", None)
        value = message.updates["value"]
        if getattr(props, "disabled", False) or not alike(value, present):
            return False
        options = getattr(props, "options", None)
        if options is not None and value not in options:
            return False
        message.updates["value"] = _clamped(value, getattr(props, "min", None), getattr(props, "max", None))
        return True


def fits(value: object, kind: Any) -> bool:
    """Check a value of a message against the type of its field."""
    if kind is Any:
        return True
    origin, inside = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return any(fits(value, each) for each in inside)
    if origin is Literal:
        return any(type(value) is type(each) and value == each for each in inside)
    if origin is tuple:
        if not isinstance(value, tuple | list):
            return False
        if len(inside) == 2 and inside[1] is Ellipsis:
            return all(fits(each, inside[0]) for each in value)
        return len(value) == len(inside) and all(map(fits, value, inside))
    if origin is dict:
        return isinstance(value, Mapping) and all(isinstance(key, str) for key in value)
    if kind in (int, float):
        return _is_number(value)
    if kind is str:
        return isinstance(value, str) and len(value) <= MAX_TEXT
    return isinstance(value, kind) if isinstance(kind, type) else True


def alike(value: object, present: object) -> bool:
    """Check whether a value has the type of the present one of a control, and its length."""
    if isinstance(present, bool):
        return isinstance(value, bool)
    if isinstance(present, int | float):
        return _is_number(value)
    if isinstance(present, str):
        return isinstance(value, str) and len(value) <= MAX_TEXT
    if isinstance(present, tuple | list) and isinstance(value, tuple | list) and len(value) == len(present):
        return all(alike(each, own) for each, own in zip(value, present, strict=True))
    return False


def _is_number(value: object) -> bool:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    return math.isfinite(value) and abs(value) <= MAX_NUMBER


def _clamped(value: Any, lower: Any, upper: Any) -> Any:
    """Return numbers within the bounds, which may be None."""
    if isinstance(value, bool | str):
        return value
    if isinstance(value, tuple | list):
        lowers = lower if isinstance(lower, tuple | list) else [lower] * len(value)
        uppers = upper if isinstance(upper, tuple | list) else [upper] * len(value)
        return tuple(map(_clamped, value, lowers, uppers))
    least = value if lower is None else max(value, lower)
    return least if upper is None else min(least, upper)


@cache
def _hints(kind: Any) -> dict[str, Any]:
    """Return the types of the fields of a message."""
    return get_type_hints(kind)


NAMES = "dynx-names"
"""Identifier of the element that holds the names of parts by the paths of their nodes, as JSON."""

HOVERED = "dynx-hovered"
"""Identifier of the element that shows the name of the part under the pointer."""

_NO_SOFTWARE_MESSAGE = "<style>#webgl-software-rendering { display: none; }</style>"
"""Hides the message of viser that software draws: dynx says so itself (a note) and has prepared for it."""

_OWN_LAYERS = """<style>
  canvas[width="0"][height="0"] { visibility: hidden; }
  [data-dock-region] { will-change: opacity; }
</style>"""
"""Keeps the panel, and viser's canvas for rectangles while it is empty, out of one transparent layer as large
as the page, which software would blend with each picture for a tenth of its time."""

_LEGEND_STYLE = (
    "position: fixed; left: 0.5em; top: 0.5em; max-width: 20em; padding: 0.1em; border-radius: 3px; "
    "font-family: sans-serif; color: black; background: rgba(255, 255, 255, 0.8)"
)
"""Style of the legend, which is read before any picture."""

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

_SAMPLES = 16
"""Largest number of places of an image whose mean a pixel shows (anisotropic filtering)."""

_OWN_COLOURS = (
    f"const ROUGHNESS = {ROUGHNESS}, SAMPLES = {_SAMPLES};"
    + """
  setInterval(() => {
    const page = window.__viserMutable, renderer = page?.scene?.__r3f?.root?.getState?.()?.gl;
    if (!renderer) return;
    let changed = renderer.toneMapping !== 0;
    renderer.toneMapping = 0;
    page.scene.traverse((each) => {
      for (const material of each.isMesh ? [each.material].flat() : []) {
        if (!material.isMeshStandardMaterial) continue;
        const roughness = window.__dynxRoughness ?? ROUGHNESS, image = material.map;
        changed ||= material.roughness !== roughness;
        material.roughness = roughness;
        if (!image || image.anisotropy === SAMPLES) continue;
        image.anisotropy = SAMPLES;
        image.needsUpdate = changed = true;
      }
    });
    if (changed) page.requestRender?.();
  }, 100);
"""
)
"""Shows colours as they are, where react-three-fiber makes them greyer, as films of analogue cameras do, and
the gloss of pictures. Images stay sharp where they are seen at a small angle."""

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
    const part = first && drawn.get(first.object);
    return Array.isArray(part) ? part[first.instanceId] : part ?? null;
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

FOLLOWED = "dynx-followed"
"""Identifier of the element that holds what the camera follows, as JSON."""

OPACITIES = "dynx-opacities"
"""Identifier of the element that holds the opacity of shapes by the paths of their nodes, as JSON."""

TEXTS = "dynx-texts"
"""Identifier of the element that holds coloured text of a program, as JSON: viser's text is black."""

# Poses and views that a program sends come in different messages, of which the page may draw one before the
# other. So the page itself shifts its camera, in each picture, by as much as the part has moved.
_BEFORE_PICTURES = (
    f"const [FOLLOWED, TEXTS, OPACITIES] = {json.dumps([FOLLOWED, TEXTS, OPACITIES])};"
    + """
  let followed = null, first = true, last = null, reset = false;
  const shift = (camera) => {
    const page = window.__viserMutable, controls = page.cameraControl;
    const source = document.getElementById(FOLLOWED)?.dataset.followed;
    if (source === undefined || controls?.camera !== camera) return;
    const wanted = JSON.parse(source);
    const world = page.nodeRefFromName[""], node = page.nodeRefFromName[wanted.path];
    if (wanted.number !== followed) {
      if (wanted.number && !(world && node)) return;
      followed = wanted.number;
      // A page that is opened later begins with the view of the start.
      const origin = first ? wanted.start : wanted.origin;
      last = wanted.number ? world.localToWorld(camera.position.clone().fromArray(origin)) : null;
    }
    else if (reset && last !== null && world)
      last = world.localToWorld(camera.position.clone().fromArray(wanted.start));
    first = reset = false;
    if (last === null || !node) return;
    const place = camera.position.clone().setFromMatrixPosition(node.matrixWorld);
    const moved = place.clone().sub(last);
    if (moved.lengthSq() === 0) return;
    last = place;
    const target = controls.getTarget(camera.position.clone(), true).add(moved);
    controls.moveTo(target.x, target.y, target.z, false);
    camera.position.add(moved);
    camera.updateMatrixWorld();
  };
  let written = "[]", texts = [];
  const writing = () => document.getElementById(TEXTS)?.dataset.texts ?? written;
  const write = (canvas, camera) => {
    const page = window.__viserMutable, world = page.nodeRefFromName[""];
    if (page.cameraControl?.camera !== camera || !world) return;
    if (writing() !== written) {
      for (const each of texts) each.node.remove();
      written = writing();
      texts = JSON.parse(written).map((each) => {
        const node = document.createElement("div");
        node.className = "dynx-text";
        node.textContent = each.text;
        node.style.cssText = "position: absolute; left: 0; top: 0; pointer-events: none; white-space: pre;"
          + "font-family: sans-serif; line-height: 1";
        node.style.color = each.colour;
        node.style.fontSize = each.size + "px";
        canvas.parentNode.append(node);
        return {node, point: each.point};
      });
    }
    const box = canvas.getBoundingClientRect();
    for (const {node, point} of texts) {
      const place = camera.position.clone().fromArray(point).applyMatrix4(world.matrixWorld).project(camera);
      const x = (0.5 + 0.5 * place.x) * box.width, y = (0.5 - 0.5 * place.y) * box.height;
      node.style.visibility = Math.abs(place.z) <= 1 ? "visible" : "hidden";
      node.style.transform = `translate(${x}px, ${y}px)`;
    }
  };
  const given = new WeakMap();
  let faded = "{}", fading = {};
  const seenThrough = () => document.getElementById(OPACITIES)?.dataset.opacities ?? faded;
  const fade = () => {
    for (const [path, colour] of Object.entries(colours))
      window.__viserMutable.nodeRefFromName[path]?.traverse((each) => {
        for (const material of each.isMesh ? [each.material].flat() : [])
          if (material.isMeshStandardMaterial) material.color.setRGB(...colour);
      });
    if (seenThrough() !== faded) fading = {...fading, ...JSON.parse(faded = seenThrough())};
    for (const [path, opacity] of Object.entries(fading))
      window.__viserMutable.nodeRefFromName[path]?.traverse((each) => {
        for (const material of each.isMesh ? [each.material].flat() : []) {
          if (!given.has(material)) given.set(material, [material.opacity, material.transparent]);
          const [own, transparent] = given.get(material);
          if (material.opacity === own * opacity) continue;
          material.opacity = own * opacity;
          material.transparent = transparent || opacity < 1;
          material.needsUpdate = true;
        }
      });
  };
  const prepare = () => {
    const page = window.__viserMutable, scene = page?.scene;
    if (!scene) return;
    if (writing() !== written || seenThrough() !== faded) page.requestRender?.();
    if (scene.dynxPrepares) return;
    scene.dynxPrepares = true;
    // The page may return to the view of the start, from which it has to follow anew.
    let resetting = page.resetCameraPose;
    Object.defineProperty(page, "resetCameraPose", {
      configurable: true,
      get: () => resetting && ((...given) => { resetting(...given); reset = true; page.requestRender?.(); }),
      set: (given) => { resetting = given; },
    });
    scene.onBeforeRender = (renderer, drawn, camera) => {
      noteShapes();
      shift(camera);
      watchCamera(camera);
      write(renderer.domElement, camera);
      fade();
      surround(renderer, scene, camera);
      castShadows(renderer, camera);
      layAxesOver();
      occlude(renderer, drawn, camera);
      // viser draws its background over the whole picture also where there is none.
      const behind = window.__viserMutable.backgroundMaterial;
      if (behind) behind.visible = behind.uniforms.enabled.value;
      drawCoarsely(renderer, drawn, camera);
    };
    scene.onAfterRender = drawWhole;
  };
  setInterval(prepare, 100);
"""
)


def opacities_element(opacities: Mapping[str, float]) -> str:
    """Return the HTML element by which the page knows the opacity of shapes, relative to their own, by the
    paths of their nodes."""
    data = escape(json.dumps(opacities), quote=True)
    return f'<div id="{OPACITIES}" style="display: none" data-opacities="{data}"></div>'


class WrittenText(NamedTuple):
    """Text on the picture, whose upper left corner is at a point of the world."""

    text: str
    point: tuple[float, float, float]
    """[m]."""
    colour: str
    """As CSS writes it."""
    size: float
    """Of the letters [pixels]."""


def texts_element(texts: Iterable[WrittenText]) -> str:
    """Return the HTML element by which the page knows the text that it writes on its picture."""
    data = escape(json.dumps([each._asdict() for each in texts]), quote=True)
    return f'<div id="{TEXTS}" style="display: none" data-texts="{data}"></div>'


INPUT = "dynx-input"
"""Identifier of the element that names the control by which the page tells of keys and of the pointer."""

_INPUT = (
    f"const INPUT = {json.dumps(INPUT)};"
    + """
  const held = new Set();
  let told = 0, moving = null;
  const tell = (data) => {
    const control = document.getElementById(INPUT)?.dataset.control, page = window.__viserMutable;
    if (!control || !page?.sendMessage) return;
    const value = JSON.stringify({...data, number: ++told});
    page.sendMessage({type: "GuiUpdateMessage", uuid: control, updates: {value}});
  };
  const tellKeys = () => tell({held: [...held]});
  const nameOf = (event) => event.code.replace(/^(Key|Digit|Numpad(?=\\d))/, "").toLowerCase();
  addEventListener("keydown", (event) => {
    const fields = "textarea, select, [contenteditable=true], input:not([type=checkbox])";
    const typed = event.target.closest?.(fields);
    if (event.repeat || typed || event.ctrlKey || event.metaKey || event.altKey) return;
    held.add(nameOf(event));
    tellKeys();
  }, true);
  addEventListener("keyup", (event) => { if (held.delete(nameOf(event))) tellKeys(); }, true);
  // A key that is released while another window has the focus is told to that one.
  const release = () => { if (held.size) { held.clear(); tellKeys(); } };
  addEventListener("blur", release);
  document.addEventListener("visibilitychange", release);
  const tellPointer = () => {
    const event = moving, page = window.__viserMutable;
    moving = null;
    const picture = page?.scene?.__r3f?.root?.getState?.(), world = page?.nodeRefFromName[""];
    const canvas = picture?.gl.domElement;
    if (!world || !canvas.parentNode.contains(event.target)) return;
    const box = canvas.getBoundingClientRect();
    const x = (event.clientX - box.left) / box.width, y = (event.clientY - box.top) / box.height;
    picture.raycaster.setFromCamera({x: 2 * x - 1, y: 1 - 2 * y}, picture.camera);
    const ray = picture.raycaster.ray.clone().applyMatrix4(world.matrixWorld.clone().invert());
    const part = hovered(event);
    tell({ray: [ray.origin.toArray(), ray.direction.toArray()], part});
  };
  addEventListener("pointermove", (event) => {
    if (!document.getElementById(INPUT)?.dataset.pointer) return;
    if (moving === null) setTimeout(tellPointer, 33);
    moving = event;
  });
"""
)


def input_element(control: str, *, pointer: bool) -> str:
    """Return the HTML element by which the page knows that it tells of keys, and of the `pointer`, by a
    control."""
    wanted = ' data-pointer="1"' if pointer else ""
    return (
        f'<div id="{INPUT}" style="display: none" data-control="{escape(control, quote=True)}"{wanted}></div>'
    )


def followed_element(number: int, path: str, origin: Sequence[float], start: Sequence[float]) -> str:
    """Return the HTML element by which the page knows what its camera follows: the node at a path, whose
    origin (3,) [m] it has in the views of the pages that are open, and had at the `start`. Each change has
    another `number`; with 0 the camera follows nothing."""
    given = {"number": number, "path": path, "origin": list(origin), "start": list(start)}
    data = escape(json.dumps(given), quote=True)
    return f'<div id="{FOLLOWED}" style="display: none" data-followed="{data}"></div>'


class Client:
    """A folder with the page, for the time of a server."""

    def __init__(self, title: str, *, antialiasing: bool) -> None:
        """Without `antialiasing` edges are jagged, and software draws twice as fast."""
        self._kept = ExitStack()
        self.folder = self._kept.enter_context(temporary_folder("dynx-page-"))
        """The folder that is served."""
        script = ALWAYS_WHOLE if antialiasing else COARSE_WHILE_MOVING
        script += FIRST_PICTURE + PLACING + _PRESSES + _OWN_COLOURS + _NAMES_ON_HOVER + SURROUNDINGS + SHADOWS
        script += (OCCLUSION if antialiasing else NO_OCCLUSION) + _BEFORE_PICTURES + _INPUT
        policy = ContentPolicy("'self' data: blob:")
        self.headers = tuple(policy.headers([HANDLER_HASH]))
        """Headers with which the page is served."""
        self._text = _guarded(CLIENT.read_text(encoding="utf-8"), script, policy)
        if not antialiasing:
            self._text = self._text.replace("</head>", f"{_NO_SOFTWARE_MESSAGE}{_OWN_LAYERS}</head>", 1)
        self.entitle(title)

    def entitle(self, title: str) -> None:
        """Give the page another title, which its tab shows when it is loaded."""
        with writing_in(self.folder):
            (self.folder / "index.html").write_text(_with_title(self._text, title), encoding="utf-8")

    def remove(self) -> None:
        """Remove the folder."""
        self._kept.close()


def names_element(names: Mapping[str, str | list[str]]) -> str:
    """Return the HTML element by which the page knows the names of parts by the paths of their nodes; of a
    node that shows many, all their names."""
    return (
        f'<div id="{NAMES}" style="display: none" data-names="{escape(json.dumps(names), quote=True)}"></div>'
    )


def standalone(
    page: str,
    title: str,
    names: Mapping[str, str | list[str]],
    *,
    legend: str = "",
    software: bool = False,
    elements: str = "",
) -> str:
    """Return a page of viser's that needs no server, with a title, the names of parts by the paths of their
    nodes, HTML that is laid over the corner of the picture, and the elements of coloured text and of opacity.

    With `software` the page does not say that software draws it: its meshes were reduced for that.
    """
    policy = ContentPolicy("data: blob:")
    script = ALWAYS_WHOLE + FIRST_PICTURE + PLACING + _OWN_COLOURS + _NAMES_ON_HOVER + SURROUNDINGS + SHADOWS
    script += OCCLUSION + _BEFORE_PICTURES
    page = _guarded(page, script, policy)
    meta = f'<meta http-equiv="Content-Security-Policy" content="{escape(policy.text(), quote=True)}">'
    page = page.replace("<head>", f"<head>{meta}", 1)
    body = page.rfind("</body>")
    if body < 0:
        return page
    added = names_element(names) + elements
    if legend:
        added += f'<div style="{_LEGEND_STYLE}">{legend}</div>'
    if software:
        added += _NO_SOFTWARE_MESSAGE
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
