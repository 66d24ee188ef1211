"""Contract: a world does what it is told and nothing else; pictures are the frame's own memory; same seed, same bytes."""

import gc
import multiprocessing
from multiprocessing.connection import Connection

import numpy as np
import pytest

import dsm

SCENE = dsm.find_scene("apartment")
KITCHEN = (-1.6, 2.9, 3.1)


def world(**options: object) -> dsm.World:
    return dsm.World(SCENE, seed=1, start=KITCHEN, **options)  # type: ignore[arg-type]


def picture(seen: dsm.World) -> dsm.Frame:
    """The first picture, which comes with the first period of the camera."""
    assert seen.read() is None, "reading lets no time pass"
    seen.step(duration_s=0.2)
    frame = seen.read()
    assert frame is not None and seen.read() is None, "a picture is read once"
    return frame


def test_pictures_are_shared_and_cannot_be_written() -> None:
    frame = picture(world())
    color, depth = frame.color, frame.depth
    assert color.shape == (480, 640, 3) and color.dtype == np.uint8
    assert depth.shape == (480, 640) and depth.dtype == np.float32
    assert np.shares_memory(color, frame.color) and np.shares_memory(depth, frame.depth)
    with pytest.raises(ValueError):
        color[0, 0, 0] = 1
    with pytest.raises(ValueError):
        depth.setflags(write=True)
    kept = color.copy()
    del frame
    gc.collect()
    assert (color == kept).all(), "an array keeps its frame alive"


def test_the_same_seed_gives_the_same_pictures() -> None:
    first, second = world(), world()
    for one in (first, second):
        one.step(base=(0.1, 0.4), duration_s=0.6)
    a, b = first.read(), second.read()
    assert a is not None and b is not None and a.stamp_s == b.stamp_s > 0.0
    assert a.color.tobytes() == b.color.tobytes() and a.depth.tobytes() == b.depth.tobytes()
    assert picture(dsm.World(SCENE, seed=2, start=KITCHEN)).color.tobytes() != picture(world()).color.tobytes()


def test_base_head_tool_and_fingers_do_as_they_are_told() -> None:
    moved = world(perception="oracle")
    before = moved.state()
    moved.step(duration_s=1.0)
    still = moved.state()
    assert still["time_s"] == pytest.approx(before["time_s"] + 1.0)
    assert np.allclose(still["arm_positions"], before["arm_positions"], atol=0.01)
    for _ in range(10):
        moved.step(base=(0.0, 0.5), head=(0.4, 0.0), gripper=(0.08, 20.0), duration_s=0.1)
        moved.read()
    after = moved.state()
    turned = np.linalg.inv(still["world_from_base"]) @ after["world_from_base"]
    assert 0.3 < np.arctan2(turned[1, 0], turned[0, 0]) < 0.6
    assert after["head_positions"][0] == pytest.approx(still["head_positions"][0] + 0.4, abs=0.1)
    assert after["gripper_width_m"] == pytest.approx(0.08, abs=0.01)
    moved.step(base=(0.0, 0.0), duration_s=0.5)
    start = moved.state()["base_from_tool"][:3, 3]
    moved.step(tool=(0.0, 0.0, 0.1, 0.0, 0.0, 0.0), duration_s=1.0)
    end = moved.state()["base_from_tool"][:3, 3]
    assert end[2] - start[2] == pytest.approx(0.1, abs=0.03), "the tool rises by what its velocity says"
    assert np.linalg.norm((end - start)[:2]) < 0.03


def test_commands_are_held_to_the_limits() -> None:
    fast = world(perception="oracle")
    for _ in range(10):
        fast.step(base=(0.0, 50.0), duration_s=0.1)
        fast.read()
    assert abs(fast.state()["base_velocity"][1]) <= fast.limits["base_turn_rad_per_s"] * 1.05


def test_a_stopped_robot_stays_stopped() -> None:
    stopped = world()
    stopped.stop("a test stops it")
    with pytest.raises(dsm.RunError, match="a test stops it"):
        stopped.step(base=(0.2, 0.0), duration_s=0.5)


def test_bad_input_is_named() -> None:
    one = world()
    with pytest.raises(dsm.InputError, match="8: lift_joint"):
        one.step(arm=[0.0, 0.0])
    with pytest.raises(dsm.InputError, match="one of them"):
        one.step(arm=[0.0] * 8, tool=[0.0] * 6)
    with pytest.raises(dsm.InputError, match="duration_s is -1"):
        one.step(duration_s=-1.0)
    with pytest.raises(dsm.Error, match="wrist"):
        one.read("third eye")
    with pytest.raises(dsm.InputError, match="did you mean `apple_2`"):
        world(expect=[{"kind": "object_lifted", "object": "apple_one"}])
    with pytest.raises(dsm.InputError, match="expected object"):
        world(expect=[{"kind": "object_lifted"}])
    with pytest.raises(dsm.InputError, match="unknown variant"):
        world(expect=[{"kind": "object_liked"}])
    with pytest.raises(dsm.InputError, match="`fridge` is in the way"):
        dsm.World(SCENE, start=(-4.66, 4.14, 0.0))
    with pytest.raises(dsm.InputError, match="apartment"):
        dsm.find_scene("palace")


def test_a_world_tells_what_is_felt_and_no_truth() -> None:
    noisy = world()
    noisy.step(duration_s=2.0)
    believed = noisy.state()["world_from_base"]
    off_m = float(np.hypot(believed[0, 3] - KITCHEN[0], believed[1, 3] - KITCHEN[1]))
    assert 0.0 < off_m < 0.2, "the pose is that of a localiser which wanders"
    public = {name for name in dir(noisy) if not name.startswith("_")}
    assert not any(word in name for name in public for word in ("truth", "label", "object", "body")), public


def test_frames_are_made_of_arrays() -> None:
    color = np.zeros((4, 6, 3), dtype=np.uint8)
    depth = np.ones((4, 6), dtype=np.float32)
    camera = np.array([[5.0, 0.0, 3.0], [0.0, 5.0, 2.0], [0.0, 0.0, 1.0]])
    frame = dsm.Frame(color, depth, camera, np.eye(4), stamp_s=1.5, camera="wrist", id=7)
    assert (frame.id, frame.camera, frame.stamp_s) == (7, "wrist", 1.5)
    assert (frame.intrinsics == camera).all() and (frame.world_from_camera == np.eye(4)).all()
    with pytest.raises(dsm.InputError, match="color has the shape"):
        dsm.Frame(color[:2], depth, camera, np.eye(4))
    with pytest.raises(dsm.InputError, match="rigid"):
        dsm.Frame(color, depth, camera, 2.0 * np.eye(4))


def build_and_tell(connection: Connection) -> None:
    try:
        connection.send(repr(world()))
    except dsm.RunError as error:
        connection.send(str(error))


def test_a_forked_process_is_refused_and_does_not_hang() -> None:
    picture(world())
    here, there = multiprocessing.Pipe()
    child = multiprocessing.get_context("fork").Process(target=build_and_tell, args=(there,))
    child.start()
    told = here.recv()
    child.join()
    assert "do not survive" in told and "spawn" in told
