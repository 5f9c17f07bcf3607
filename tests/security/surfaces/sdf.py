"""Attacks by descriptions of robots in SDF: `dynx info`, `agree`, `convert`, `same`, pages, and shapes."""

from __future__ import annotations

import os
from collections.abc import Callable
from xml.sax.saxutils import escape, quoteattr

from tests.security.attack import URDF, Box, Deed, attacks_on, sparse
from tests.security.surfaces.description import HOSTILE
from tests.security.surfaces.page import MARK, harmless

attack = attacks_on("sdf")

INERTIAL = "<inertial><mass>1</mass></inertial>"
LINK = f'<link name="b">{INERTIAL}</link>'
SECRET_LINK = '<link name="TOP-SECRET-7719"/>'
"""Content of a model outside, whose name would be in the output."""


def model(inside: str = LINK, name: str = "m") -> str:
    """Return a model with these elements."""
    return f'<model name="{name}">{inside}</model>'


def sdf(inside: str = LINK, before: str = "") -> str:
    """Return a document of one model with these elements."""
    return f'{before}<sdf version="1.9">{model(inside)}</sdf>'


def include(uri: str, more: str = "") -> str:
    """Return an element that includes a model."""
    return f"<include><uri>{escape(uri)}</uri>{more}</include>"


def info(box: Box, text: str | bytes, ends: tuple[int, ...] = (2,)) -> Deed:
    """Write a model, which the victim reads."""
    return Deed(("info", box.file("m.sdf", text)), ends=ends)


def every_engine(box: Box, text: str, ends: tuple[int, ...] = (0, 1, 2)) -> Deed:
    """Write a model, which the victim loads with every engine."""
    return Deed(("agree", box.file("m.sdf", text)), ends=ends)


def seen(box: Box, text: str, ends: tuple[int, ...] = (0, 2)) -> Deed:
    """Write a model whose shapes the victim draws."""
    return Deed((box.file("m.sdf", text),), "seen", ends)


def mesh(uri: str) -> str:
    """Return a model whose link looks like a mesh, and has the mass of it."""
    shape = f"<geometry><mesh><uri>{escape(uri)}</uri></mesh></geometry>"
    return sdf(
        f'<link name="b"><inertial auto="true"/><visual name="v">{shape}</visual>'
        f'<collision name="c">{shape}</collision></link>'
    )


def outside(box: Box) -> str:
    """Write a model that nobody named, beside the secrets, and return its path."""
    path = box.outside / "secret.sdf"
    path.write_text(sdf(SECRET_LINK))
    return str(path)


@attack("code", "modules and plug-ins beside the file")
def _(box: Box) -> Deed:
    for name in ("struct", "json", "numpy", "pydrake", "mujoco", "sitecustomize"):
        box.file(f"{name}.py", box.code)
    box.file("libowned.so", b"\x7fELF" + bytes(64))
    plugin = f'<plugin name="p" filename="{box.here}/libowned.so"><script>{box.code}</script></plugin>'
    return every_engine(box, sdf(LINK + plugin), (0,))


@attack("code", "text of Ruby and xacro, which generators of SDF execute")
def _(box: Box) -> Deed:
    return info(box, sdf(f'<link name="b"><inertial><mass>${{{box.code}}}</mass></inertial></link>'))


@attack("path", "include of a path outside")
def _(box: Box) -> Deed:
    return info(box, sdf(include(outside(box))))


@attack("path", "include that climbs")
def _(box: Box) -> Deed:
    outside(box)
    return every_engine(box, sdf(include("../outside/secret.sdf")), (2,))


@attack("path", "include by an address of a file outside")
def _(box: Box) -> Deed:
    return info(box, sdf(include(f"file://{outside(box)}")))


@attack("path", "include by an address whose letters are coded")
def _(box: Box) -> Deed:
    outside(box)
    return info(box, sdf(include(f"file://{box.here}/%2e%2e/outside/secret.sdf")))


@attack("path", "include of a model that climbs out of its folder")
def _(box: Box) -> Deed:
    outside(box)
    box.file("arm/model.config", '<model><name>arm</name><sdf version="1.9">a.sdf</sdf></model>')
    box.file("arm/a.sdf", sdf())
    return info(box, sdf(include("model://arm/../../outside/secret.sdf")))


@attack("path", "include of a model that is the folder above")
def _(box: Box) -> Deed:
    outside(box)
    return info(box, sdf(include("model://../outside/secret.sdf") + include("model://outside/secret.sdf")))


@attack("path", "manifest that names a file outside")
def _(box: Box) -> Deed:
    manifest = f'<model><name>arm</name><sdf version="1.9">{outside(box)}</sdf></model>'
    box.file("arm/model.config", manifest)
    return info(box, sdf(include("model://arm")))


@attack("path", "manifest that climbs")
def _(box: Box) -> Deed:
    outside(box)
    box.file("arm/model.config", '<model><sdf version="1.9">../../outside/secret.sdf</sdf></model>')
    return info(box, sdf(include("arm")))


@attack("path", "mesh outside")
def _(box: Box) -> Deed:
    return every_engine(box, mesh(f"{box.outside}/secret.stl"), (2,))


@attack("path", "mesh of a model that climbs")
def _(box: Box) -> Deed:
    box.file("arm/model.config", "<model/>")
    return seen(box, mesh("model://arm/../../outside/secret.stl"))


@attack("path", "mesh of an included model that climbs from its own folder")
def _(box: Box) -> Deed:
    box.file("sub/a.sdf", mesh("../../outside/secret.obj"))
    return seen(box, sdf(include("sub/a.sdf")))


@attack("path", "entity that is a file")
def _(box: Box) -> Deed:
    kind = f'<!DOCTYPE sdf [<!ENTITY x SYSTEM "file://{box.outside}/secret.txt">]>'
    return every_engine(box, sdf(LINK.replace('"b"', '"&x;"'), kind), (2,))


@attack("path", "conversion of names and meshes that lead elsewhere")
def _(box: Box) -> Deed:
    stl = (box.outside / "secret.stl").read_bytes().replace(b"TOP-SECRET-7719", b"a")
    box.file("sub/..\\..\\outside\\owned.stl", stl)
    text = mesh("sub/..\\..\\outside\\owned.stl").replace('"b"', '"../../outside/owned"')
    return Deed(("convert", box.file("m.sdf", text), "-o", "out.xml"), ends=(0, 1, 2))


@attack("link", "model that leads to an endless device")
def _(box: Box) -> Deed:
    (box.here / "m.sdf").symlink_to("/dev/zero")
    return Deed(("info", "m.sdf"))


@attack("link", "include that leads outside")
def _(box: Box) -> Deed:
    (box.here / "a.sdf").symlink_to(outside(box))
    return info(box, sdf(include("a.sdf")))


@attack("link", "folder of a model that leads outside")
def _(box: Box) -> Deed:
    outside(box)
    (box.outside / "model.config").write_text('<model><sdf version="1.9">secret.sdf</sdf></model>')
    (box.here / "arm").symlink_to(box.outside)
    return info(box, sdf(include("model://arm")))


@attack("link", "mesh that leads outside")
def _(box: Box) -> Deed:
    (box.here / "a.stl").symlink_to(box.outside / "secret.stl")
    return every_engine(box, mesh("a.stl"), (2,))


@attack("link", "links that lead to each other")
def _(box: Box) -> Deed:
    (box.here / "a.sdf").symlink_to("c.sdf")
    (box.here / "c.sdf").symlink_to("a.sdf")
    return info(box, sdf(include("a.sdf")))


@attack("device", "include of an endless device")
def _(box: Box) -> Deed:
    return info(box, sdf(include("/dev/zero") + include("file:///dev/stdin")))


@attack("device", "include of a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "a.sdf")
    return info(box, sdf(include("a.sdf")))


@attack("device", "manifest that is a pipe")
def _(box: Box) -> Deed:
    (box.here / "arm").mkdir()
    os.mkfifo(box.here / "arm" / "model.config")
    return info(box, sdf(include("model://arm")))


@attack("device", "mesh that is a pipe")
def _(box: Box) -> Deed:
    os.mkfifo(box.here / "a.obj")
    return every_engine(box, mesh("a.obj"), (2,))


@attack("network", "models and meshes from elsewhere")
def _(box: Box) -> Deed:
    uris = ("http://192.0.2.1/a.sdf", "HTTPS://192.0.2.1/a", "fuel://192.0.2.1/a", "//192.0.2.1/a.sdf")
    return info(box, sdf("".join(map(include, uris))))


@attack("network", "mesh and image from elsewhere")
def _(box: Box) -> Deed:
    image = "<material><script><uri>http://192.0.2.1/s</uri><name>a</name></script></material></visual>"
    return seen(box, mesh("http://192.0.2.1/m.dae").replace("</visual>", image))


@attack("bomb", "entities that grow")
def _(box: Box) -> Deed:
    entities = "".join(f'<!ENTITY a{k} "' + 10 * f"&a{k - 1};" + '">' for k in range(1, 12))
    kind = f'<!DOCTYPE sdf [<!ENTITY a0 "ha">{entities}]>'
    return every_engine(box, sdf(f"<link name='b'><pose>&a11;</pose>{INERTIAL}</link>", kind), (2,))


@attack("bomb", "includes that double")
def _(box: Box) -> Deed:
    for k in range(40):
        twice = "".join(include(f"a{k + 1}.sdf", f"<name>{name}</name>") for name in "xy")
        box.file(f"a{k}.sdf", sdf(twice if k < 39 else LINK))
    return info(box, sdf(include("a0.sdf")))


@attack("bomb", "one file of many frames, included many times")
def _(box: Box) -> Deed:
    frames = "".join(f'<frame name="f{k}"/>' for k in range(200_000))
    box.file("a.sdf", sdf(LINK + frames))
    return info(box, sdf("".join(include("a.sdf", f"<name>a{k}</name>") for k in range(900))))


@attack("bomb", "one file of many elements that are not used, included many times")
def _(box: Box) -> Deed:
    sensors = "".join(f'<sensor name="s{k}" type="imu"/>' for k in range(200_000))
    box.file("a.sdf", sdf(f'<link name="b">{sensors}</link>'))
    return info(box, sdf("".join(include("a.sdf", f"<name>a{k}</name>") for k in range(900))))


@attack("bomb", "one file of many shapes, included many times")
def _(box: Box) -> Deed:
    box.file(
        "a.sdf",
        sdf(f'<link name="b">{"<visual/>" * 200_000}</link>').replace("<link", "<static>1</static><link"),
    )
    return info(box, sdf("".join(include("a.sdf", f"<name>a{k}</name>") for k in range(900))))


@attack("bomb", "names that are sought in many merged models")
def _(box: Box) -> Deed:
    for k in range(400):
        box.file(f"a{k}.sdf", sdf(f'<link name="b{k}">{INERTIAL}</link>'))
    parts = "".join(f'<include merge="true"><uri>a{k}.sdf</uri></include>' for k in range(400))
    frames = "".join(f'<frame name="f{k}" attached_to="b399"/>' for k in range(90_000))
    return info(box, sdf(parts + frames))


@attack("bomb", "include of a large file")
def _(box: Box) -> Deed:
    sparse(box.here / "a.sdf", 20 * 10**9, b"<sdf version='1.9'>")
    return info(box, sdf(include("a.sdf")))


@attack("bomb", "manifest that is a large file")
def _(box: Box) -> Deed:
    (box.here / "arm").mkdir()
    sparse(box.here / "arm" / "model.config", 20 * 10**9, b"<model>")
    return info(box, sdf(include("arm")))


@attack("bomb", "manifest of versions without end")
def _(box: Box) -> Deed:
    versions = '<sdf version="1.5">a.sdf</sdf>' * 1_000_000
    box.file("arm/model.config", f"<model>{versions}</model>")
    return info(box, sdf(include("arm")))


@attack("bomb", "links without end")
def _(box: Box) -> Deed:
    return info(box, sdf("".join(f'<link name="b{k}"/>' for k in range(500_000))))


@attack("bomb", "frames without end, each in the one before")
def _(box: Box) -> Deed:
    frames = "".join(
        f'<frame name="f{k}" attached_to="{f"f{k - 1}" if k else "b"}"><pose>0 0 1 0 0 0</pose></frame>'
        for k in range(90_000)
    )
    return info(box, sdf(LINK + frames), (0, 2))


@attack("bomb", "shapes without end")
def _(box: Box) -> Deed:
    shapes = "".join(
        f'<collision name="c{k}"><geometry><sphere><radius>1</radius></sphere></geometry></collision>'
        for k in range(300_000)
    )
    return info(box, sdf(f'<link name="b"><inertial auto="true"/>{shapes}</link>'), (0, 2))


@attack("bomb", "numbers without end")
def _(box: Box) -> Deed:
    return info(box, sdf(f'<link name="b"><pose>{"1 " * 5_000_000}</pose></link>'))


@attack("bomb", "mesh of a large file")
def _(box: Box) -> Deed:
    sparse(box.here / "a.stl", 3 * 10**9, bytes(80) + (60_000_000).to_bytes(4, "little"))
    return every_engine(box, mesh("a.stl"), (2,))


@attack("bomb", "two robots of many links that are compared")
def _(box: Box) -> Deed:
    parts = "".join(f'<link name="b{k}">{INERTIAL}</link>' for k in range(3000))
    joints = "".join(
        f'<joint name="j{k}" type="ball"><parent>b{k}</parent><child>b{k + 1}</child></joint>'
        for k in range(2999)
    )
    text = sdf(parts + joints.replace("ball", "fixed"))
    box.file("n.sdf", text.replace('"b7"', '"c7"').replace(">b7<", ">c7<"))
    return Deed(("same", box.file("m.sdf", text), "n.sdf"), ends=(0, 1, 2))


@attack("recursion", "include of itself")
def _(box: Box) -> Deed:
    return info(box, sdf(include("m.sdf")))


@attack("recursion", "models that include each other by their manifests")
def _(box: Box) -> Deed:
    for own, other in (("arm", "hand"), ("hand", "arm")):
        box.file(f"{own}/model.config", '<model><sdf version="1.9">model.sdf</sdf></model>')
        box.file(f"{own}/model.sdf", sdf(include(f"model://{other}")))
    return info(box, sdf(include("model://arm")))


@attack("recursion", "includes of each other by paths")
def _(box: Box) -> Deed:
    box.file("sub/a.sdf", sdf(include("b/../b.sdf")))
    (box.here / "sub" / "b").mkdir()
    box.file("sub/b.sdf", sdf(include("././a.sdf")))
    return info(box, sdf(include("sub//a.sdf")))


@attack("recursion", "models in models")
def _(box: Box) -> Deed:
    return info(box, sdf('<model name="m">' * 50_000 + LINK + "</model>" * 50_000))


@attack("recursion", "elements in elements that are not read")
def _(box: Box) -> Deed:
    return info(box, sdf(LINK + "<plugin name='p'>" * 100_000 + "</plugin>" * 100_000))


@attack("recursion", "frames in a circle")
def _(box: Box) -> Deed:
    ring = "".join(f'<frame name="f{k}" attached_to="f{(k + 1) % 50_000}"/>' for k in range(50_000))
    return info(box, sdf(LINK + ring))


@attack("recursion", "poses in a circle")
def _(box: Box) -> Deed:
    pose = '<link name="{}">' + INERTIAL + '<pose relative_to="{}">0 0 1 0 0 0</pose></link>'
    return info(box, sdf(pose.format("a", "b") + pose.format("b", "a")))


@attack("recursion", "joints that follow each other")
def _(box: Box) -> Deed:
    joint = (
        '<joint name="{0}" type="revolute"><parent>b</parent><child>c{0}</child><axis>'
        '<mimic joint="{1}"><multiplier>1</multiplier><offset>0</offset><reference>0</reference></mimic>'
        '</axis></joint><link name="c{0}"/>'
    )
    return info(box, sdf(LINK + joint.format("j", "k") + joint.format("k", "j")))


def _value(name: str, old: str, new: str) -> Callable[[Box], Deed]:
    def prepare(box: Box) -> Deed:
        text = sdf(
            f'{LINK}<link name="c"><pose>1 2 3 0 0 0</pose>{INERTIAL}</link><joint name="j" type="revolute">'
            "<parent>b</parent><child>c</child><axis><xyz>0 1 0</xyz></axis></joint>"
        )
        assert old in text
        return info(box, text.replace(old, new))

    prepare.__name__ = name
    return prepare


for _name, _old, _new in (
    ("pose that is not finite", "1 2 3 0", "nan inf 1e999 0"),
    ("mass that is no number", "<mass>1<", "<mass>%s%n{0}<"),
    ("mass of many digits", "<mass>1<", f"<mass>{'9' * 100_000}<"),
    ("axis of zero", "0 1 0", "0 0 0"),
    ("kind of joint that does not exist", "revolute", "__class__"),
    ("version that is text", '"1.9"', '"1.9; import os"'),
    ("version of many digits", '"1.9"', f'"{"1" * 10_000}.9"'),
    ("name of many letters", '"c"', f'"{"c" * 1_000_000}"'),
    ("name that is reserved", '"c"', '"__model__"'),
    ("joint of a link to itself", "<child>c<", "<child>b<"),
    ("no element at all", "<joint", "<\x00joint"),
):
    attack("type", _name)(_value(_name, _old, _new))


@attack("type", "text in another encoding")
def _(box: Box) -> Deed:
    return info(box, b'<?xml version="1.0" encoding="utf-7"?>' + sdf().encode("utf-16"))


@attack("type", "description of another format that is included")
def _(box: Box) -> Deed:
    box.file("a.urdf", URDF)
    return info(box, sdf(include("a.urdf")))


@attack("html", "names that are elements of a page")
def _(box: Box) -> Deed:
    name = quoteattr(f"</script><script>{MARK}()</script><img src={MARK} onerror={MARK}()>")
    shape = f"<visual name={name}><geometry><box><size>1 1 1</size></box></geometry></visual>"
    box.file("m.sdf", sdf(f"<link name={name}>{INERTIAL}{shape}</link>"))
    return Deed(
        ("view", "m.sdf", "--export", "out.html"),
        ends=(0,),
        check=harmless(box.here / "out.html"),
    )


@attack("terminal", "names that command a terminal")
def _(box: Box) -> Deed:
    frame = f'<frame name="{HOSTILE}"/>'
    return info(box, sdf(f'<link name="x{HOSTILE}">{INERTIAL}</link>{frame}'), (0, 2))


@attack("terminal", "unknown elements, files and models that command a terminal")
def _(box: Box) -> Deed:
    return info(
        box,
        sdf(LINK + f"<include><uri>a\x85\u202e\u2066\u2028%s.sdf</uri><\u202dx y='{HOSTILE}'/></include>"),
    )


@attack("terminal", "files that are included and not there")
def _(box: Box) -> Deed:
    return info(box, sdf(LINK + include("a\x85\u202e\u2066\u2028%s%n{0.__class__}.sdf")))


@attack("printf", "names that are formats")
def _(box: Box) -> Deed:
    return every_engine(box, sdf(LINK.replace('"b"', '"%n%s{0.__class__}%(x)s"')))
