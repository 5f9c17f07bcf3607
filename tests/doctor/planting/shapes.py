"""Planters of DX425 to DX429: defects of collision shapes and materials that decide whether a file loads."""

from __future__ import annotations

from tests.doctor.planting.site import PlantedDefect, Planter, Site


def without_size(site: Site) -> PlantedDefect:
    """A collision of an exporter that knew no shape, or a plate without thickness."""
    name, link = site.pick_link(lambda each: True, "link")
    shape = site.rng.choice(
        [
            '<box size="0 0 0"/>',
            '<box size="0.2 0.3 0"/>',
            '<sphere radius="0.0"/>',
            '<cylinder radius="0" length="0.1"/>',
            '<cylinder radius="0.05" length="0"/>',
            '<box size="-0.1 0.1 0.1"/>',
            '<cylinder radius="0.05"/>',
            '<mesh filename=""/>',
        ]
    )
    text = f"<collision>\n  <geometry>\n    {shape}\n  </geometry>\n</collision>"
    return site.defect("DX425", site.source.insertion(link, text), link=name)


def unexpanded_number(site: Site) -> PlantedDefect:
    """A collision of a file that was written for xacro, and never expanded."""
    name, link = site.pick_link(lambda each: True, "link")
    origin, shape = site.rng.choice(
        [
            ('<origin rpy="${pi/2} 0 0"/>', '<box size="0.1 0.1 0.1"/>'),
            ('<origin xyz="0 ${width / 2} 0"/>', '<sphere radius="0.1"/>'),
            ("", '<sphere radius="${wheel_radius}"/>'),
            ("", '<cylinder radius="${0.1 / 2}" length="$(arg length)"/>'),
        ]
    )
    text = f"<collision>\n  {origin}\n  <geometry>\n    {shape}\n  </geometry>\n</collision>"
    return site.defect("DX429", site.source.insertion(link, text), link=name)


def lost_texture(site: Site) -> PlantedDefect:
    """The image of a material that was not copied with the description."""
    image = site.rng.choice(
        ["file:///usr/share/no_such_robot/wood.png", "package://robot_description/textures/wood.jpg"]
    )
    color = site.rng.choice(["", '<color rgba="1 1 1 1"/>\n  '])
    return _material(
        site, "DX426", f'<material name="planted_texture">\n  {color}<texture filename="{image}"/>\n', image
    )


def without_colour(site: Site) -> PlantedDefect:
    """A material whose colour was never written, or has three numbers."""
    inside, sign = site.rng.choice(
        [
            ("<texture/>", "planted_colour"),
            ('<color rgba="0.3 0.2 0.1"/>', 'rgba="0.3 0.2 0.1"'),
            ('<color rgb="0.3 0.2 0.1"/>', 'rgb="0.3 0.2 0.1"'),
        ]
    )
    return _material(site, "DX427", f'<material name="planted_colour">\n  {inside}\n', sign)


def _material(site: Site, rule: str, text: str, sign: str) -> PlantedDefect:
    edit = site.source.insertion(site.source.root, f"{text}</material>", first=site.rng.random() < 0.5)
    return site.defect(rule, edit, sign=sign)


def visual_incomplete(site: Site) -> PlantedDefect:
    """A visual from a template that was not filled in."""
    name, link = site.pick_link(site.skeleton.solid, "body")
    shape, material = site.rng.choice(
        [
            ("<sphere/>", ""),
            ('<cylinder radius="0.1"/>', ""),
            ('<mesh filename=""/>', ""),
            ('<box size="0.1 0.1 0.1"/>', '<material name="grey_50"><color rgba="0.5 0.5 0.5"/></material>'),
            ('<box size="0.1 0.1 0.1"/>', '<material><color rgba="0.5 0.5 0.5 1"/></material>'),
            ('<mesh filename="package://nowhere/a.stl"/>', '<material name="x"><color/></material>'),
        ]
    )
    text = f"<visual>\n  <geometry>{shape}</geometry>\n  {material}\n</visual>"
    return site.defect("DX428", site.source.insertion(link, text), link=name)


PLANTERS = (
    Planter("DX428", visual_incomplete),
    Planter("DX425", without_size),
    Planter("DX429", unexpanded_number),
    Planter("DX426", lost_texture),
    Planter("DX427", without_colour),
)
