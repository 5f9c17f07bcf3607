"""Planters of DX117 to DX119: tiny offsets, heavy links and robots without inertial data."""

from __future__ import annotations

from dynx.model.xml.source import Edit, SourceElement
from tests.doctor.planting.inertia import MOMENTS, PRODUCTS, mass, tensor, weightless
from tests.doctor.planting.site import CannotPlant, PlantedDefect, Planter, Site

_LEAST_GAP = 2e-15
"""Difference of two products [kg m^2] that PyBullet's bound of 1.1e-15 does not admit."""


def tiny_offset(site: Site) -> PlantedDefect:
    """A centre of mass that a CAD program found a fraction of a micrometre off the axis."""
    name, link = _body(site)
    size = site.skeleton.size(name)
    moments = sorted((size * site.rng.uniform(0.6, 1.0) for _ in MOMENTS), reverse=True)
    words = {each: f"{value:.6g}" for each, value in zip(MOMENTS, moments, strict=True)}
    xyz = " ".join(f"{site.rng.choice((-1, 1)) * site.rng.uniform(2e-7, 9e-7):.4g}" for _ in range(3))
    edits = tensor(site, link, **words, **dict.fromkeys(PRODUCTS, "0"))
    return site.defect("DX117", *edits, *_origin(site, link, xyz), link=name)


def heavy_link(site: Site) -> PlantedDefect:
    """A beam of hundreds of kilograms whose centre of mass is off all axes."""
    name, link = _body(site)
    m, x, y, z = _unsymmetric(site)
    squares = (y * y + z * z, x * x + z * z, x * x + y * y)
    size = m * (x * x + y * y + z * z)
    words = {each: f"{0.5 * (size + m * square):.6g}" for each, square in zip(MOMENTS, squares, strict=True)}
    edits = [*mass(site, link, repr(m)), *tensor(site, link, **words, **dict.fromkeys(PRODUCTS, "0"))]
    return site.defect("DX119", *edits, *_origin(site, link, f"{x!r} {y!r} {z!r}"), link=name)


def no_inertial_data(site: Site) -> PlantedDefect:
    """A description for display: no inertial in any link, or zeros in all."""
    removed = site.rng.random() < 0.5
    edits: list[Edit] = []
    for link in site.source.root.all("link"):
        for inertial in link.all("inertial"):
            edits += [site.source.removal(inertial)] if removed else weightless(site, link)
    names = [part.attributes.get("name", "") for part in site.source.root.children]
    return site.defect("DX118", *edits, touched=names, sign="<robot")


def _unsymmetric(site: Site) -> tuple[float, float, float, float]:
    """Draw a mass and a centre whose products differ by the order in which they are taken."""
    while True:
        m = round(site.rng.uniform(200.0, 900.0), 1)
        x, y, z = (round(site.rng.uniform(0.2, 0.8), 3) for _ in range(3))
        if any(abs((m * a) * b - (m * b) * a) > _LEAST_GAP for a, b in ((x, y), (x, z), (y, z))):
            return m, x, y, z


def _body(site: Site) -> tuple[str, SourceElement]:
    skeleton = site.skeleton
    return site.pick_link(
        lambda each: (
            skeleton.solid(each)
            and skeleton.is_single_body(each)
            and skeleton.ranks[each] > 0
            and skeleton.size(each) > 1e-4 * skeleton.largest_inertia
        ),
        "body on a joint",
    )


def _origin(site: Site, link: SourceElement, xyz: str) -> list[Edit]:
    inertial = link.first("inertial")
    if inertial is None:
        raise CannotPlant("the link has no inertial")
    origin = inertial.first("origin")
    if origin is None:
        return [site.source.insertion(inertial, f'<origin xyz="{xyz}"/>', first=True)]
    return [
        site.source.attribute_edit(origin, "xyz", xyz),
        site.source.attribute_edit(origin, "rpy", "0 0 0"),
    ]


PLANTERS = (
    Planter("DX117", tiny_offset),
    Planter("DX118", no_inertial_data, alone=True),
    Planter("DX119", heavy_link),
)
