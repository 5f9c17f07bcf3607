"""Attacks by descriptions of robots in URDF and xacro: `dynx info`, `agree`, `doctor`, `view`."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from xml.sax.saxutils import quoteattr

from tests.security.attack import URDF, Box, Deed, attacks_on, sparse

attack = attacks_on("urdf")

INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
HOSTILE = "a\x85\u202e\u2066&quot;'</script><script>alert(1)</script>%s%n{0.__class__}\u2028$\\frac{"


def info(box: Box, text: str | bytes, ends: tuple[int, ...] = (2,), name: str = "r.urdf") -> Deed:
    """Write a description, which the victim reads."""
    return Deed(("info", box.file(name, text)), ends=ends)


def arm(name: str = "b", extra: str = "", joint: str = "j") -> str:
    """Return the description of a link on a joint."""
    return (
        f'<robot name="r"><link name="a"/><link name={quoteattr(name)}>{INERTIAL}{extra}</link>'
        f'<joint name={quoteattr(joint)} type="continuous"><parent link="a"/><child link={quoteattr(name)}/>'
        '<axis xyz="0 1 0"/></joint></robot>'
    )


def mesh(filename: str) -> str:
    """Return a shape of a mesh, drawn and for collisions."""
    geometry = f"<geometry><mesh filename={quoteattr(filename)}/></geometry>"
    return f"<visual>{geometry}</visual><collision>{geometry}</collision>"


def every_engine(box: Box, text: str, ends: tuple[int, ...] = (0, 1, 2)) -> Deed:
    """Write a description, which the victim loads with every engine."""
    return Deed(("agree", box.file("r.urdf", text)), ends=ends)


def examined(
    box: Box,
    text: str,
    *words: str,
    ends: tuple[int, ...] = (0, 1, 2),
    check: Callable[[str], str | None] | None = None,
    name: str = "r.urdf",
) -> Deed:
    """Write a description, which the victim examines."""
    return Deed(("doctor", box.file(name, text), "--samples", "1", *words), ends=ends, check=check)


def xacro(body: str, root: str = "") -> str:
    """Return a xacro file."""
    return f'<robot xmlns:xacro="http://ros.org/wiki/xacro" name="r">{root}<link name="base"/>{body}</robot>'


@attack("code", "xacro in a file that is no xacro file")
def _(box: Box) -> Deed:
    return info(box, xacro("").replace('"base"', f'"${{{box.code}}}"'), ends=(0, 2))


@attack("code", "include of a xacro file in a URDF")
def _(box: Box) -> Deed:
    return info(box, xacro(f'<xacro:include filename="{box.outside}/secret.xacro"/>'), ends=(0, 2))


@attack("code", "call of the engine in the name of a file")
def _(box: Box) -> Deed:
    name = f"r');__import__('os').system('touch ..{os.sep}owned')#.urdf".replace("/", "\u2215")
    return examined(box, arm(), name=name)


@attack("code", "call of the engine in the names of parts")
def _(box: Box) -> Deed:
    name = f"b\\\"'); {box.code} #\n"
    text = arm(name, joint=name).replace('name="r"', f"name={quoteattr(name)}")
    return examined(box, text.replace('link name="a"', 'link name="world"').replace('"a"', '"world"'))


@attack("code", "modules beside the file")
def _(box: Box) -> Deed:
    for name in ("struct", "json", "numpy", "xacro", "pinocchio", "sitecustomize", "yaml", "glfw"):
        box.file(f"{name}.py", box.code)
    return every_engine(box, arm(), (0,))


@attack("network", "document type from elsewhere")
def _(box: Box) -> Deed:
    return info(box, '<!DOCTYPE robot SYSTEM "http://192.0.2.1/a.dtd">' + URDF)


@attack("path", "entity that is a file")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return every_engine(box, kind + URDF.replace('"base"', '"&x;"'), (2,))


@attack("path", "entity of a parameter")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE robot [<!ENTITY % x SYSTEM "file://{box.outside}/secret.txt"> %x;]>'
    return examined(box, kind + URDF, ends=(2,))


@attack("path", "inclusion by XInclude")
def _(box: Box) -> Deed:
    inside = f'<x:include xmlns:x="http://www.w3.org/2001/XInclude" href="{box.outside}/secret.urdf"/>'
    return every_engine(box, arm().replace("</robot>", f"{inside}</robot>"))


@attack("path", "mesh outside, for every engine")
def _(box: Box) -> Deed:
    return every_engine(box, arm(extra=mesh("../outside/secret.stl")))


@attack("path", "mesh outside, for every engine as its users load it")
def _(box: Box) -> Deed:
    return examined(
        box, arm(extra=mesh(f"{box.outside}/secret.obj") + mesh(f"file://{box.outside}/secret.stl"))
    )


@attack("path", "image of a material outside")
def _(box: Box) -> Deed:
    material = f'<material name="m"><texture filename="{box.outside}/secret.bin"/></material>'
    shape = f"<visual><geometry><box size='1 1 1'/></geometry>{material}</visual>"
    other = shape.replace(f"{box.outside}", "package://../outside").replace('"m"', '"n"')
    return Deed((box.file("a.urdf", arm(extra=shape + other)),), "seen", (0,))


@attack("path", "mesh in a package above")
def _(box: Box) -> Deed:
    return examined(
        box, arm(extra=mesh("package://../outside/secret.stl") + mesh("package://outside/secret.stl"))
    )


@attack("path", "texture outside")
def _(box: Box) -> Deed:
    material = f'<material name="m"><texture filename="{box.outside}/secret.bin"/></material>'
    visual = f'<visual><geometry><box size="1 1 1"/></geometry>{material}</visual>'
    return examined(box, arm(extra=visual))


@attack("network", "mesh from elsewhere")
def _(box: Box) -> Deed:
    return examined(box, arm(extra=mesh("http://192.0.2.1/m.stl")))


@attack("link", "description that leads to an endless device")
def _(box: Box) -> Deed:
    (box.here / "r.urdf").symlink_to("/dev/zero")
    return Deed(("info", "r.urdf"))


@attack("link", "mesh that leads outside")
def _(box: Box) -> Deed:
    (box.here / "m.stl").symlink_to(box.outside / "secret.stl")
    return examined(box, arm(extra=mesh("m.stl")))


@attack("device", "mesh that is an endless device")
def _(box: Box) -> Deed:
    return examined(box, arm(extra=mesh("file:///dev/zero") + mesh("/dev/zero")))


@attack("device", "mesh that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "m.stl")
    os.mkfifo(box.here / "m.obj")
    return examined(box, arm(extra=mesh("m.stl") + mesh("m.obj")))


@attack("device", "description that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "r.urdf")
    return Deed(("doctor", "r.urdf"))


@attack("bomb", "entities that grow")
def _(box: Box) -> Deed:
    entities = '<!ENTITY a0 "ha">' + "".join(
        f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, 12)
    )
    return every_engine(box, f"<!DOCTYPE robot [{entities}]>" + URDF.replace('"base"', '"&a11;"'), (2,))


@attack("bomb", "attributes without end")
def _(box: Box) -> Deed:
    attributes = " ".join(f'a{k}=""' for k in range(300_000))
    return info(box, f'<robot name="r"><link name="a" {attributes}/></robot>')


@attack("bomb", "elements without end")
def _(box: Box) -> Deed:
    return info(box, '<robot name="r"><link name="a">' + "<x/>" * (10**7) + "</link></robot>")


@attack("bomb", "faults without end that are repaired")
def _(box: Box) -> Deed:
    return info(
        box, '<robot name="r"><link name="a"/>' + "<!-- -- -->&<!x>" * (3 * 10**6) + "</robot>", ends=(0, 2)
    )


@attack("bomb", "start tag that never ends")
def _(box: Box) -> Deed:
    return info(box, '<robot name="r"><link ' + 'a = "' * (10**7))


@attack("bomb", "sparse file")
def _(box: Box) -> Deed:
    sparse(box.here / "r.urdf", 2**36, URDF.encode())
    return Deed(("info", "r.urdf"))


@attack("bomb", "digits without end")
def _(box: Box) -> Deed:
    return info(box, arm().replace('value="1"', f'value="{"9" * 10**7}e-9999999"'), ends=(0, 2))


@attack("recursion", "elements in one another")
def _(box: Box) -> Deed:
    return every_engine(box, '<robot name="r">' + "<link>" * 100_000, (2,))


@attack("recursion", "chain of ten thousand links")
def _(box: Box) -> Deed:
    links = "".join(f'<link name="l{k}"/>' for k in range(10_001))
    joints = "".join(
        f'<joint name="j{k}" type="fixed"><parent link="l{k}"/><child link="l{k + 1}"/></joint>'
        for k in range(10_000)
    )
    return info(box, f'<robot name="r">{links}{joints}</robot>', ends=(0, 2))


@attack("recursion", "joints in a circle")
def _(box: Box) -> Deed:
    joint = '<joint name="j{0}" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    links = '<link name="a"/><link name="b"/>'
    return info(box, f'<robot name="r">{links}{joint.format("a", "b")}{joint.format("b", "a")}</robot>')


@attack("recursion", "joints that follow one another")
def _(box: Box) -> Deed:
    mimic = '<mimic joint="j" multiplier="1e300" offset="-1e308"/></joint>'
    return info(box, arm().replace("</joint>", mimic))


@attack("recursion", "xacro file that includes itself")
def _(box: Box) -> Deed:
    return info(box, xacro('<xacro:include filename="r.xacro"/>'), name="r.xacro")


@attack("recursion", "macro that calls itself")
def _(box: Box) -> Deed:
    return info(box, xacro("<xacro:m/>", '<xacro:macro name="m"><xacro:m/></xacro:macro>'), name="r.xacro")


@attack("bomb", "xacro that computes without end")
def _(box: Box) -> Deed:
    return info(box, xacro('<link name="${9**9**9}"/>'), name="r.xacro")


@attack("bomb", "xacro that fills the memory")
def _(box: Box) -> Deed:
    return info(box, xacro("<link name=\"${'a'*10**10}\"/>"), name="r.xacro")


@attack("bomb", "xacro that doubles a text")
def _(box: Box) -> Deed:
    body = "".join(f'<xacro:property name="p{k + 1}" value="${{p{k}}}${{p{k}}}"/>' for k in range(40))
    return info(
        box, xacro('<link name="${p40}"/>', f'<xacro:property name="p0" value="aaaa"/>{body}'), name="r.xacro"
    )


@attack("bomb", "entities that grow in xacro")
def _(box: Box) -> Deed:
    entities = '<!ENTITY a0 "ha">' + "".join(
        f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, 12)
    )
    return info(box, f"<!DOCTYPE robot [{entities}]>" + xacro('<link name="&a11;"/>'), name="r.xacro")


@attack("path", "entity that is a file in xacro")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE robot [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    body = '<xacro:property name="p" value="&x;"/><link name="${p}"/><link name="l">&x;</link>'
    return info(box, kind + xacro(body), ends=(0, 2), name="r.xacro")


@attack("network", "entity from elsewhere in xacro")
def _(box: Box) -> Deed:
    kind = '<!DOCTYPE robot [<!ENTITY x SYSTEM "http://192.0.2.1/x">]>'
    return info(box, kind + xacro("<link name='l'>&x;</link>"), ends=(0, 2), name="r.xacro")


@attack("device", "xacro that includes an endless device")
def _(box: Box) -> Deed:
    return info(box, xacro('<xacro:include filename="/dev/zero"/>'), name="r.xacro")


@attack("device", "xacro that includes a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "p.xacro")
    return info(box, xacro('<xacro:include filename="p.xacro"/>'), name="r.xacro")


@attack("type", "other encodings")
def _(box: Box) -> Deed:
    return info(box, ('<?xml version="1.0" encoding="utf-7"?>' + URDF).encode("utf-16") + b"\0\xff\xfe")


@attack("type", "numbers that are none, or beyond all floats")
def _(box: Box) -> Deed:
    text = arm().replace('value="1"', 'value="nan"').replace('ixx="1"', 'ixx="0x1p9999"')
    return every_engine(box, text.replace("0 1 0", "inf 1e999 -0"), (2,))


@attack("type", "half of a pair of surrogates, and zero bytes")
def _(box: Box) -> Deed:
    return info(box, b'<robot name="\xed\xa0\x80\0"><link name="&#xD800;&#0;"/></robot>')


@attack("type", "folder in the place of a file")
def _(box: Box) -> Deed:
    (box.here / "r.urdf").mkdir()
    return Deed(("info", "r.urdf"))


@attack("html", "names in the page of the doctor")
def _(box: Box) -> Deed:
    text = arm(HOSTILE, joint=HOSTILE).replace(INERTIAL, "").replace('name="r"', f"name={quoteattr(HOSTILE)}")
    return examined(box, text, "--html", "out.html", check=plain_page(box.here / "out.html"))


def plain_page(path: Path) -> Callable[[str], str | None]:
    """Return a check of a page without scripts."""

    def check(_: str) -> str | None:
        if not path.exists():
            return None
        page = path.read_text(encoding="utf-8").lower()
        return "a script of the attacker's in the page" if "<script>alert" in page or "<img" in page else None

    return check


@attack("printf", "commands of GitHub in names")
def _(box: Box) -> Deed:
    name = "x%0A::error::owned\n::set-output name=a::b\r\n::warning file=a,line=1::c"
    text = arm(name, joint=name).replace(INERTIAL, "")

    def check(output: str) -> str | None:
        wrong = [
            line
            for line in output.splitlines()
            if line.startswith(("::set-output", "::error::owned", "::warning file=a,"))
        ]
        return f"a command of the attacker's: {wrong[0]}" if wrong else None

    return examined(box, text, "--github", check=check)


@attack("terminal", "escape sequences in names")
def _(box: Box) -> Deed:
    return info(box, arm("b\x9b2J\u202e\u2066\u200b", joint="j\x9d0;x\x9c\u061c"), ends=(0, 2))


@attack("terminal", "escape sequences in comments and attributes that are wrong")
def _(box: Box) -> Deed:
    return info(box, arm().replace("continuous", "\u202e\x9b2J").replace("<axis", "<!-- \x1b[2J --><axis"))


@attack("terminal", "escape sequences in the name of the file")
def _(box: Box) -> Deed:
    return examined(box, arm(), name="r\x1b[2J\u202e\n\r.urdf")


@attack("printf", "formats in names, for every engine")
def _(box: Box) -> Deed:
    return every_engine(
        box, arm("%s%n%d%s%n", joint="{0.__class__}%n").replace('name="r"', 'name="%n%s"'), (0, 1, 2)
    )
