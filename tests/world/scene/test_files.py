"""Files of scenes: round trips, the scenes of dynx, and faults named by their place."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import (
    ArgumentError,
    DescriptionError,
    DynxError,
    NotFiniteError,
    RobotNotFoundError,
    UnknownNameError,
)
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Ellipsoid, HeightField, Sphere
from dynx.world import (
    Material,
    PDMotor,
    PointToPoint,
    PositionMotor,
    Scene,
    SceneBody,
    SceneRobot,
    Weld,
    ground,
    read_scene,
    scene_names,
    write_scene,
)
from dynx.world.scene.documents import scene_document, scene_from_document

numbers = st.floats(-10.0, 10.0, allow_nan=False)
sizes = st.floats(0.01, 2.0)
vectors = st.tuples(numbers, numbers, numbers)
poses = st.builds(dynx.Pose, vectors, vectors)
materials = st.builds(
    Material, friction=sizes, restitution=st.floats(0.0, 1.0), rgba=st.tuples(*[st.floats(0.0, 1.0)] * 4)
)
solids = st.one_of(
    st.builds(Box, st.tuples(sizes, sizes, sizes)),
    st.builds(Sphere, sizes),
    st.builds(Cylinder, sizes, sizes),
    st.builds(Capsule, sizes, sizes),
    st.builds(Ellipsoid, st.tuples(sizes, sizes, sizes)),
)
shapes = st.lists(st.builds(Collision, solids, poses), min_size=1, max_size=3).map(tuple)
names = st.text("abcdefgh_", min_size=1, max_size=6)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    """Return scenes of bodies of every kind, with a robot, constraints and filters."""
    called = draw(st.lists(names, min_size=2, max_size=5, unique=True).filter(lambda x: "world" not in x))
    bodies = [ground(called[0])]
    for name in called[1:]:
        moving = (
            {"mass": draw(sizes), "twist": tuple(draw(st.tuples(*[numbers] * 6)))}
            if draw(st.booleans())
            else {}
        )
        bodies.append(SceneBody(name, draw(shapes), draw(poses), material=draw(materials), **moving))  # type: ignore[arg-type]
    pendulum = dynx.load("pendulum")
    motor = PositionMotor(draw(numbers), kp=draw(sizes), kd=draw(sizes), joints=pendulum.joint_names[:1])
    robot = SceneRobot("the robot", pendulum, motors=(motor,) if draw(st.booleans()) else ())
    link = f"the robot/{pendulum.links[-1].name}"
    joined = [PointToPoint(link, "world", draw(vectors), draw(vectors))]
    if not bodies[1].fixed:
        joined.append(Weld(called[1], "world", draw(poses)))  # type: ignore[arg-type]
    return Scene(
        draw(names),
        (robot,),
        tuple(bodies),
        tuple(joined),
        ignored=((called[0], "all"),),
        groups=(("all", tuple(called)),),
        gravity=draw(vectors),
    )


def require_robots() -> None:
    """Skip a test that needs a robot of example-robot-data."""
    if "ur5" not in {entry.name for entry in dynx.robots()}:
        pytest.skip("needs example-robot-data")


@given(scenes())
def test_a_document_gives_an_equal_scene(scene: Scene) -> None:
    document = json.loads(json.dumps(scene_document(scene)))
    assert scene_from_document(document) == scene


@pytest.mark.parametrize("suffix", [".toml", ".json"])
def test_a_file_gives_an_equal_scene(suffix: str, tmp_path: Path) -> None:
    if suffix == ".toml":
        pytest.importorskip("tomli_w")
    heights = HeightField(((0.0, 0.1), (0.2, 0.3), (0.1, 0.0)), (2.0, 3.0))
    scene = Scene("text \"with\" 'quotes' \\ and ünïcode", bodies=(SceneBody("hills", heights),))
    path = tmp_path / f"scene{suffix}"
    write_scene(scene, path)
    assert read_scene(path) == scene


@pytest.mark.parametrize("name", scene_names())
def test_the_scenes_of_dynx_are_read_and_written(name: str, tmp_path: Path) -> None:
    if name in ("lifting", "pushing", "standing"):
        require_robots()
    if name in ("duck", "rolling"):
        pytest.importorskip("pybullet_data")
    scene = read_scene(name)
    assert scene.name == name
    write_scene(scene, tmp_path / "copy.json")
    again = read_scene(tmp_path / "copy.json")
    assert again == scene
    assert [robot.model.geometry for robot in again.robots] == [
        robot.model.geometry for robot in scene.robots
    ]


def test_a_robot_of_a_file_has_its_state_by_names(tmp_path: Path) -> None:
    require_robots()
    path = tmp_path / "arm.toml"
    path.write_text(
        """schema = "dynx.scene/1"
[[robots]]
name = "arm"
robot = "ur5"
pose = [1.0, 0.0, 0.5, 0.0, 0.0, 1.5]
q = { elbow_joint = 0.5 }
v = { elbow_joint = -1.0 }
motors = [{ kind = "pd", target = 0.0, kp = 10.0, kd = 1.0 }]
[[robots]]
name = "flying"
robot = "ur5"
base = "floating"
pose = [0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0]
"""
    )
    scene = read_scene(path)
    arm, flying = scene.robots
    assert arm.model.base_pose == dynx.Pose((1.0, 0.0, 0.5), (0.0, 0.0, 1.5))
    assert arm.q == (0.0, 0.0, 0.5, 0.0, 0.0, 0.0)
    assert arm.v == (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
    assert arm.motors == (PDMotor(0.0, 10.0, 1.0),)
    np.testing.assert_array_equal(np.array(flying.q)[:7], [0, 0, 2, 0, 0, 0, 1])


BODY: dict[str, Any] = {"name": "b", "shape": {"box": [1, 1, 1]}}

FAULTS: list[tuple[dict[str, Any], type[DynxError], str]] = [
    ({"schema": "dynx.scene/2"}, ArgumentError, "wanted schema = 'dynx.scene/1'"),
    ({"bodys": []}, ArgumentError, "no key 'bodys'; did you mean 'bodies'"),
    (
        {"bodies": [{**BODY, "masss": 1.0}]},
        ArgumentError,
        r"bodies\[0\], 'b' has no key 'masss'; did you",
    ),
    ({"bodies": [{**BODY, "mass": "1"}]}, ArgumentError, r"bodies\[0\], 'b': mass is '1'; wanted a number"),
    ({"bodies": [{**BODY, "mass": -1.0}]}, ArgumentError, r"bodies\[0\], 'b': mass of body 'b' is '-1"),
    ({"bodies": [{**BODY, "mass": float("nan")}]}, ArgumentError, "mass of body 'b' is 'nan"),
    ({"bodies": [{**BODY, "pose": [1.0, float("nan"), 0.0]}]}, NotFiniteError, r"bodies\[0\], 'b': pose"),
    ({"bodies": [{**BODY, "pose": [0, 0, 0, 0, 0, 0, 2]}]}, ArgumentError, "norm 1"),
    ({"bodies": [{**BODY, "pose": [0, 0]}]}, ArgumentError, "pose has 2 numbers; wanted 3, 6 or 7"),
    ({"bodies": [BODY, BODY]}, ArgumentError, "two parts of the scene are called 'b'"),
    ({"bodies": [{"name": "b"}]}, ArgumentError, "wanted either shape or shapes"),
    ({"bodies": [{"name": "b", "shape": {}}]}, ArgumentError, "it has none"),
    ({"bodies": [{"name": "b", "shape": {"box": [1, 1, 1], "sphere": 1}}]}, ArgumentError, "box and sphere"),
    ({"bodies": [{"name": "b", "shape": {"box": [1, 0, 1]}}]}, ArgumentError, r"size of a box\[1\] is 0"),
    (
        {"bodies": [{"name": "b", "shape": {"sphere": 1.0, "scale": [1]}}]},
        ArgumentError,
        "belongs to mesh",
    ),
    ({"bodies": [{"name": "b", "shape": {"cylinder": [1]}}]}, ArgumentError, "wanted radius and length"),
    ({"bodies": [{**BODY, "material": {"friction": -1}}]}, ArgumentError, "friction is '-1"),
    ({"robots": [{"name": "r"}]}, ArgumentError, "wanted either robot"),
    ({"robots": [{"name": "r", "robot": "ur55"}]}, ArgumentError, "from elsewhere may not name; wanted urdf"),
    ({"robots": [{"name": "r", "urdf": "<robot"}]}, DynxError, r"robots\[0\], 'r'"),
    ({"constraints": [{"kind": "weld", "a": "world", "b": "c"}]}, UnknownNameError, "no part 'c'"),
    ({"constraints": [{"kind": "hinge", "a": "b", "b": "c"}]}, ArgumentError, "hinge"),
    ({"bodies": [BODY], "ignored": [["b", "c"]]}, UnknownNameError, "no part 'c'"),
    ({"gravity": [0, 0]}, ArgumentError, "gravity"),
]


@pytest.mark.parametrize(("change", "kind", "message"), FAULTS)
def test_a_fault_is_named_with_its_place(change: dict[str, Any], kind: type[DynxError], message: str) -> None:
    with pytest.raises(kind, match=message):
        scene_from_document({"schema": "dynx.scene/1", **change})


def test_a_scene_of_pybullet_data_is_found_by_its_path_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    data = importlib.util.find_spec("pybullet_data")
    if data is None or data.origin is None:
        pytest.skip("needs pybullet_data")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotNotFoundError, match="no such file"):
        read_scene("mjcf/no_such_scene.xml")
    found = read_scene("mjcf/striker.xml")
    assert found.name == read_scene(Path(data.origin).parent / "mjcf/striker.xml").name
    assert len(found.robots) + len(found.bodies) >= 3


def test_files_that_are_no_scene_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotNotFoundError, match="did you mean 'stack'"):
        read_scene("stak")
    with pytest.raises(RobotNotFoundError, match="no such file"):
        read_scene(tmp_path / "absent.toml")
    for content in (b"a = [", b"\xff\xfe\x00", b"[" * 100_000, b"x = 1"):
        path = tmp_path / "bad.toml"
        path.write_bytes(content)
        with pytest.raises(ArgumentError, match=r"bad\.toml"):
            read_scene(path)
    with pytest.raises(ArgumentError, match=r"\.toml or \.json"):
        write_scene(Scene("empty"), tmp_path / "scene.yaml")


CUBE = "\n".join(
    ["solid cube"]
    + [
        f"facet normal 0 0 0\nouter loop\nvertex {a}\nvertex {b}\nvertex {c}\nendloop\nendfacet"
        for a, b, c in [
            ("0 0 0", "0 1 0", "1 0 0"),
            ("0 0 0", "1 0 0", "0 0 1"),
            ("0 0 0", "0 0 1", "0 1 0"),
            ("1 0 0", "0 1 0", "0 0 1"),
        ]
    ]
    + ["endsolid cube", ""]
)


def scene_with_mesh(folder: Path, mesh: str) -> Path:
    folder.mkdir(exist_ok=True)
    path = folder / "scene.json"
    document = {"schema": "dynx.scene/1", "bodies": [{"name": "b", "shape": {"mesh": mesh}, "mass": 1.0}]}
    path.write_text(json.dumps(document))
    return path


def test_meshes_lie_beside_the_scene_or_where_the_user_says(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    for folder in (inside, outside):
        folder.mkdir()
        (folder / "cube.stl").write_text(CUBE)
    scene = read_scene(scene_with_mesh(inside, "cube.stl"))
    assert scene.body("b").inertial.mass == 1.0
    write_scene(scene, inside / "copy.json")
    assert json.loads((inside / "copy.json").read_text())["bodies"][0]["shape"]["mesh"] == "cube.stl"
    for name in ("../outside/cube.stl", str(outside / "cube.stl")):
        path = scene_with_mesh(inside, name)
        with pytest.raises(DescriptionError, match="outside the folder of the scene"):
            read_scene(path)
        assert read_scene(path, package_dirs=[outside]).body("b").shapes
    (inside / "link.stl").symlink_to(outside / "cube.stl")
    with pytest.raises(DescriptionError, match="outside the folder of the scene"):
        read_scene(scene_with_mesh(inside, "link.stl"))
    with pytest.raises(DescriptionError, match=r"did you mean 'cube\.stl'"):
        read_scene(scene_with_mesh(inside, "cub.stl"))
    with pytest.raises(DescriptionError, match="wanted a path or package"):
        read_scene(scene_with_mesh(inside, "http://example.org/cube.stl"))


def test_a_document_from_elsewhere_reads_no_file_of_the_user(tmp_path: Path) -> None:
    (tmp_path / "cube.stl").write_text(CUBE)
    given = {"name": "b", "shape": {"mesh": str(tmp_path / "cube.stl")}}
    with pytest.raises(DescriptionError, match="outside the folder of the scene"):
        scene_from_document({"schema": "dynx.scene/1", "bodies": [given]})


@pytest.mark.skipif(importlib.util.find_spec("xacro") is None, reason="xacro is not installed")
def test_a_robot_in_xacro_has_arguments(tmp_path: Path) -> None:
    (tmp_path / "arm.xacro").write_text(
        '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="$(arg link)"/></robot>'
    )
    (tmp_path / "scene.toml").write_text(
        'schema = "dynx.scene/1"\n[[robots]]\nname = "r"\nrobot = "arm.xacro link:=base"\n'
    )
    assert read_scene(tmp_path / "scene.toml").robots[0].model.links[0].name == "base"
