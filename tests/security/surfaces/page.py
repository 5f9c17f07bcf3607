"""Attacks on the pages that dynx writes, by names of robots, bodies, joints and files."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from xml.sax.saxutils import quoteattr

from tests.security.attack import Box, Deed, attacks_on
from tests.security.surfaces.description import arm

attack = attacks_on("page")

MARK = "owned9931"
"""Word of the attacker's, by which it is recognised."""

VISUAL = '<visual><geometry><box size="1 1 1"/></geometry></visual>'


class _Page(HTMLParser):
    """What of a page has the word of the attacker where a browser would act on it."""

    def __init__(self) -> None:
        super().__init__(convert_charrefs=True)
        self.wrong: list[str] = []
        self.policies: list[str] = []
        self._inside = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if MARK in tag:
            self.wrong.append(f"element {tag}")
        for name, value in attrs:
            acts = name.startswith("on") or name in ("src", "href", "action", "srcdoc", "style", "http-equiv")
            if MARK in name or (acts and MARK in (value or "")):
                self.wrong.append(f"attribute {name} of {tag}")
        given = dict(attrs)
        if tag == "meta" and (given.get("http-equiv") or "").lower() == "content-security-policy":
            self.policies.append(given.get("content") or "")
        self._inside = tag

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside in ("script", "style") and MARK in data:
            self.wrong.append(f"text of <{self._inside}>")


def harmless(path: Path, *, policy: bool = True) -> Callable[[str], str | None]:
    """Return a check of a page: nothing of the attacker's acts, and a content security policy is first."""

    def check(_: str) -> str | None:
        text = path.read_text(encoding="utf-8")
        page = _Page()
        page.feed(text)
        if page.wrong:
            return f"the attacker's word is {page.wrong[0]}"
        if policy and not page.policies:
            return "no content security policy"
        if policy and any(
            "unsafe-inline" in each.partition("script-src")[2].partition(";")[0] for each in page.policies
        ):
            return "the policy lets any script run"
        return None

    return check


SCRIPT = f"</script><script>{MARK}()</script>"
IMAGE = f"\"'><img src={MARK} onerror={MARK}()><{MARK}>"
ATTRIBUTE = f'" onmouseover="{MARK}()" style="{MARK}'
COMMENT = f"<!--<script>{MARK}()//--></title></style></textarea></template>"
TEMPLATE = f"{{{{ {MARK}.__class__ }}}}{{% include '{MARK}' %}}${{{MARK}}}"
JSON_END = f"\\u003c/script\\u003e'];{MARK}();//"


def robot(box: Box, name: str) -> Deed:
    """Write a robot whose parts have a name, and let the victim export its page."""
    text = arm(name, VISUAL, joint=name).replace('name="r"', f"name={quoteattr(name)}")
    return Deed(
        ("view", box.file("r.urdf", text), "--export", "out.html"),
        ends=(0,),
        check=harmless(box.here / "out.html"),
    )


def scene(box: Box, name: str) -> Deed:
    """Write a scene whose parts have a name, and let the victim export its page."""
    body = {"name": name, "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}
    document = {"schema": "dynx.scene/1", "name": name, "bodies": [body]}
    words = ("view", box.file("s.json", json.dumps(document)), "--duration", "0.02", "--export", "out.html")
    return Deed(words, ends=(0,), check=harmless(box.here / "out.html"))


def examined(box: Box, name: str) -> Deed:
    """Write a robot whose parts have a name, and let the victim write the page of the doctor."""
    text = arm(name, joint=name).replace("<inertial>", "<inertial >").replace('value="1"', 'value="-1"')
    words = ("doctor", box.file("r.urdf", text), "--samples", "1", "--html", "out.html")

    def check(output: str) -> str | None:
        path = box.here / "out.html"
        return harmless(path, policy=False)(output) if path.exists() else "no page"

    return Deed(words, ends=(0, 1, 2), check=check)


def _register(name: str, text: str, of: Callable[[Box, str], Deed]) -> None:
    attack("html", name)(lambda box: of(box, text))


for _name, _text in (
    ("end of a script", SCRIPT),
    ("image with a handler", IMAGE),
    ("attribute with a handler", ATTRIBUTE),
    ("comment and ends of elements", COMMENT),
    ("templates", TEMPLATE),
    ("end of a text in a script", JSON_END),
):
    _register(f"{_name} in a robot", _text, robot)
for _name, _text in (("end of a script", SCRIPT), ("image with a handler", IMAGE), ("comment", COMMENT)):
    # A slash in the name of a body is refused.
    _register(f"{_name} in a scene", _text.replace("/", ""), scene)
    _register(f"{_name} in a report", _text, examined)


@attack("html", "name of the file")
def _(box: Box) -> Deed:
    name = f"a<img src=x onerror={MARK}()>.urdf"
    words = ("view", box.file(name, arm(extra=VISUAL)), "--export", "out.html")
    return Deed(words, ends=(0,), check=harmless(box.here / "out.html"))


@attack("html", "material and colour")
def _(box: Box) -> Deed:
    material = f'<material name="{MARK}"><color rgba="1 0 0 1);background:url({MARK})"/></material>'
    text = arm(extra=VISUAL.replace("</visual>", f"{material}</visual>"))
    words = ("view", box.file("r.urdf", text), "--export", "out.html")
    return Deed(words, ends=(0, 2), check=lambda output: _if_there(box.here / "out.html", output))


def _if_there(path: Path, output: str) -> str | None:
    return harmless(path)(output) if path.exists() else None


@attack("path", "page that is written where a link leads")
def _(box: Box) -> Deed:
    name = "../../outside/new"
    text = arm(name, VISUAL, joint=name).replace('name="r"', f"name={quoteattr(name)}")
    return Deed(("view", box.file("r.urdf", text), "--export", "out.html"), ends=(0,))


@attack("printf", "formats in names")
def _(box: Box) -> Deed:
    return robot(box, "%s%n%(x)s{0.__class__}{")


@attack("terminal", "control characters in names")
def _(box: Box) -> Deed:
    return replace(robot(box, "a\x85\x9b2J\u202e\ufeff"), ends=(2,), check=None)
