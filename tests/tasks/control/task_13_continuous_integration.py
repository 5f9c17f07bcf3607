"""A check of robot descriptions for continuous integration."""

import subprocess
import tempfile
from pathlib import Path

from tests.tasks.robots import ball, two_link_arm
from tests.tasks.task import Task, existing, require


def sound() -> str:
    """Return a description with nothing wrong."""
    text = two_link_arm(tip=ball("tip", 0.2, 0.05, "1 0 0 1"))
    text = text.replace('  <link name="base"/>\n', ball("base", 1.0, 0.07, "0.2 0.2 0.2 1"))
    limit = '<limit lower="-2.5" upper="2.5" effort="60" velocity="3"/>'
    return text.replace('<limit lower="-20" upper="20" effort="500" velocity="100"/>', limit)


def hidden_files() -> dict[str, tuple[str, bool]]:
    """Return texts of descriptions and whether each is sound."""
    text = sound()
    start = text.index('<link name="forearm">')
    end = text.index("</inertial>", start) + len("</inertial>")
    massless = text[: start + len('<link name="forearm">')] + text[end:]
    return {
        "sound.urdf": (text, True),
        "other.urdf": (text.replace('mass value="2.0"', 'mass value="2.4"'), True),
        "inertia.urdf": (
            text.replace('izz="0.0001"', 'izz="0.5"'),
            False,
        ),
        "massless.urdf": (massless, False),
        "negative.urdf": (text.replace('mass value="2.0"', 'mass value="-2.0"'), False),
        "parent.urdf": (text.replace('parent link="upper_arm"', 'parent link="upperarm"'), False),
        "broken.urdf": (text.replace("</robot>", ""), False),
    }


def check(folder: Path) -> None:
    """Run the script on files that the user has not seen."""
    script = existing(folder, "check.sh").resolve()
    with tempfile.TemporaryDirectory() as place:
        for name, (text, valid) in hidden_files().items():
            path = Path(place, name)
            path.write_text(text)
            try:
                code = subprocess.run(
                    ["bash", str(script), str(path)], cwd=script.parent, capture_output=True, timeout=120
                ).returncode
            except subprocess.TimeoutExpired:
                code = -1
            require(code != -1, f"check.sh takes over two minutes for {name}")
            require(code not in (126, 127), f"check.sh runs a command that does not exist (exit code {code})")
            require((code == 0) == valid, f"check.sh ends with {code} for {name}")


TASK = Task(
    "Let CI check robot descriptions",
    """
Your lab keeps robot descriptions in a repository. CI shall refuse a URDF file that has one of these errors:
- it is no well-formed XML, or a joint names a link that does not exist;
- a mass is negative, or an inertia is one that no body can have;
- a link other than the root has no inertial element.
A file without these errors must pass, such as the file sound.urdf.

Write check.sh. `bash check.sh FILE` must end with exit code 0 for a sound file and with another one
otherwise. It is tried on seven files that you do not see.
""",
    check,
    {"sound.urdf": sound},
)
