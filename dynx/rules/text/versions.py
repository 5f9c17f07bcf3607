"""The version of URDF that a robot states."""

from __future__ import annotations

from dynx.model.urdf.origins import reads_quaternions
from dynx.rules.case import Case
from dynx.rules.text.quaternions import origins_with_quaternion

KNOWN_VERSIONS = ("1.0", "1.1", "1.2")


def corrected_version(case: Case) -> str:
    """Return the version stated, 1.0 where there is none; for an unknown one (DX416) that of its remedy: 1.2
    where a later version has an origin with a quaternion, else 1.0."""
    version = case.source.root.attributes.get("version")
    if version in KNOWN_VERSIONS:
        return version
    newer = reads_quaternions(version) and any(origins_with_quaternion(case))
    return KNOWN_VERSIONS[-1] if newer else KNOWN_VERSIONS[0]
