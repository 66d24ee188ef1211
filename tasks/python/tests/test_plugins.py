"""Contract: a detector, a language backend or a driver written in Python takes the place of the built-in one, and what it
raises is raised again."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import dsm

SCENE = dsm.find_scene("apartment")
KITCHEN = (-1.6, 2.9, 3.1)


class NearThings:
    """Everything nearer than two metres is one thing."""

    name = "near-things"

    def __init__(self) -> None:
        self.stamps: list[float] = []

    def detect(self, frame: dsm.Frame) -> list[dsm.Detection]:
        self.stamps.append(frame.stamp_s)
        mask = (frame.depth > 0.0) & (frame.depth < 2.0)
        return [dsm.Detection(mask, "Box", 0.9)] if mask.sum() > 500 else []


def turn(session: dsm.Session, duration_s: float = 6.0) -> None:
    session.step(base=(0.0, 0.6), duration_s=duration_s)
    session.step(duration_s=1.0)


def test_a_detector_of_ones_own_makes_the_map() -> None:
    detector = NearThings()
    session = dsm.Session(SCENE, seed=1, start=KITCHEN, detector=detector)
    turn(session)
    assert len(detector.stamps) > 25 and detector.stamps == sorted(detector.stamps)
    assert {thing["name"] for thing in session.map.objects} == {"box"}
    assert session.map.ground("the box")["candidates"]
    session.finish()


def test_runs_with_such_a_detector_are_alike() -> None:
    maps = []
    for _ in range(2):
        session = dsm.Session(SCENE, seed=1, start=KITCHEN, detector=NearThings())
        turn(session, 3.0)
        maps.append(session.map.objects)
        session.finish()
    assert maps[0] == maps[1]


def test_what_a_detector_raises_ends_the_run() -> None:
    class Breaks:
        def detect(self, frame: dsm.Frame) -> list[dsm.Detection]:
            raise ZeroDivisionError("the network is gone")

    with pytest.raises(ZeroDivisionError, match="the network is gone"):
        dsm.run_episode(dsm.find_episode("navigate_kitchen"), detector=Breaks())

    class Small:
        def detect(self, frame: dsm.Frame) -> list[dsm.Detection]:
            return [dsm.Detection(np.ones((4, 4), dtype=np.bool_), "speck")]

    with pytest.raises(dsm.InputError, match=r"mask of `speck` is \(4, 4\); expected \(480, 640\)"):
        turn(dsm.Session(SCENE, seed=1, start=KITCHEN, detector=Small()))
    with pytest.raises(dsm.InputError, match="no method `detect`"):
        dsm.Session(SCENE, detector=object())  # type: ignore[arg-type]
    with pytest.raises(dsm.InputError, match="score is 2"):
        dsm.Detection(np.ones((4, 4), dtype=np.bool_), "speck", 2.0)


def test_a_box_becomes_a_mask_of_what_stands_in_its_middle() -> None:
    depth = np.full((40, 60), 3.0, dtype=np.float32)
    depth[10:30, 20:40] = 1.0
    camera = np.array([[50.0, 0.0, 30.0], [0.0, 50.0, 20.0], [0.0, 0.0, 1.0]])
    frame = dsm.Frame(np.zeros((40, 60, 3), dtype=np.uint8), depth, camera, np.eye(4))
    mask = dsm.mask_from_box(frame, (15.0, 5.0, 45.0, 35.0))
    assert (mask == (depth == 1.0)).all()
    assert not dsm.mask_from_box(frame, (70.0, 0.0, 90.0, 10.0)).any(), "outside of the picture is nothing"


def test_words_are_read_by_ones_own_backend(explored: dsm.Map) -> None:
    class Chills:
        name = "chills"

        def __init__(self) -> None:
            self.known: list[str] = []

        def read(self, text: str, object_names: Sequence[str]) -> list[dict[str, Any]]:
            self.known = list(object_names)
            noun = {"kind": "thing", "word": "fridge"}
            target = {"noun": noun, "article": "definite", "attributes": [], "relations": [], "selections": []}
            return [{"target": target}]

    backend = Chills()
    answer = explored.ground("the refrigerator", language=backend)
    assert answer["status"] == "found" and answer["backend"] == "chills"
    assert "fridge" in backend.known

    class Breaks:
        def read(self, text: str, object_names: Sequence[str]) -> list[dict[str, Any]]:
            raise RuntimeError("no connection")

    answer = explored.ground("the fridge", language=Breaks())
    assert answer["status"] == "found", "the embedded grammar reads instead"
    assert "no connection" in answer["spoken"][0]["reason"]
    with pytest.raises(dsm.InputError, match="none of the methods"):
        explored.ground("the fridge", language=object())  # type: ignore[arg-type]


def test_candidates_are_verified_by_ones_own_backend(explored: dsm.Map) -> None:
    class Looks:
        def __init__(self) -> None:
            self.shapes: list[tuple[int, ...]] = []

        def verify(
            self, text: str, query: dict[str, Any], candidates: Sequence[dict[str, Any]]
        ) -> list[tuple[float, str]]:
            self.shapes = [candidate["object"].shape for candidate in candidates]
            return [(1.0, "it looks right") for _ in candidates]

    looks = Looks()
    answer = explored.ground("the chair next to the table", language=looks)
    assert looks.shapes and set(looks.shapes) == {(120, 160, 3)}
    assert answer["backend"] == "Looks"


class Forwarding:
    """A driver that hands everything on to a simulated robot: what a robot of one's own would do with its buses."""

    waits_for_work = True

    def __init__(self, world: dsm.World) -> None:
        self.world = world
        self.base = (0.0, 0.0)
        self.joints: dict[str, list[float]] = {"arm": [0.0] * 8, "head": [0.0] * 2}
        self.fingers: tuple[float, float] | None = None

    def now_s(self) -> float:
        return self.world.time_s

    def wait_until(self, time_s: float) -> None:
        head = (self.joints["head"][0], self.joints["head"][1])
        left_s = time_s - self.world.time_s
        self.world.step(base=self.base, arm=self.joints["arm"], head=head, gripper=self.fingers, duration_s=left_s)

    def command_base(self, forward_m_per_s: float, turn_rad_per_s: float) -> None:
        self.base = (forward_m_per_s, turn_rad_per_s)

    def base_velocity(self) -> tuple[float, float]:
        forward, turn = self.world.state()["base_velocity"]
        return float(forward), float(turn)

    def command_joints(self, group: str, velocities: NDArray[np.float64]) -> None:
        self.joints[group] = [float(velocity) for velocity in velocities]

    def joint_state(self, group: str) -> tuple[list[float], list[float]]:
        state = self.world.state()
        if group == "arm":
            return list(state["arm_positions"]), list(state["arm_velocities"])
        return list(state["head_positions"]), self.joints["head"]

    def command_gripper(self, width_m: float, force_n: float) -> None:
        self.fingers = (width_m, force_n)

    def gripper_state(self) -> tuple[float, float, bool]:
        state = self.world.state()
        return state["gripper_width_m"], state["gripper_force_n"], False

    def cameras(self) -> list[str]:
        return self.world.cameras

    def read_camera(self, camera: str) -> dsm.Frame | None:
        return self.world.read(camera)

    def world_from_base(self) -> NDArray[np.float64]:
        return self.world.state()["world_from_base"]

    def odom_from_base(self) -> NDArray[np.float64]:
        return self.world.state()["odom_from_base"]

    def stop(self, reason: str) -> None:
        self.world.stop(reason)

    def reset(self) -> None:
        raise dsm.RunError("a world that was stopped stays so")


def test_skills_run_on_a_driver_of_ones_own() -> None:
    world = dsm.World(SCENE, seed=1, start=KITCHEN, perception="oracle")
    session = dsm.Session(SCENE, driver=Forwarding(world), detector=NearThings(), time_limit_s=40.0)
    turn(session)
    assert world.time_s == pytest.approx(session.time_s) and world.time_s >= 7.0
    assert session.map.objects and session.judge() == []
    assert np.allclose(session.state()["world_from_base"], world.state()["world_from_base"])
    summary = session.finish()
    assert summary["physics"] == "simulated" and summary["truth"]["contacts"] == []


def test_what_a_driver_raises_ends_the_run() -> None:
    class Fails(Forwarding):
        def base_velocity(self) -> tuple[float, float]:
            raise OSError("the bus is off")

    world = dsm.World(SCENE, seed=1, start=KITCHEN)
    with pytest.raises(OSError, match="the bus is off"):
        turn(dsm.Session(SCENE, driver=Fails(world)))
