"""What the functions of :mod:`dsm` give, as plain dictionaries: the same keys and values as in the JSON files."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

import numpy as np
from numpy.typing import NDArray
from typing_extensions import NotRequired

Stage = Literal[
    "parsing",
    "mapping",
    "grounding",
    "planning",
    "reach",
    "grasp",
    "hold",
    "place",
    "open",
    "safety",
    "time",
    "sequence",
    "judging",
    "crash",
]
"""The stage in which a task failed."""

Outcome = Literal["done", "absent", "ambiguous", "failed", "skipped"]
"""How a step ended. ``absent`` and ``ambiguous`` are refusals: the robot did not act."""

Vector3 = tuple[float, float, float]


class Candidate(TypedDict):
    """One thing that words may mean."""

    object_id: int | None
    room_id: int | None
    score: float
    reasons: list[str]


class Grounding(TypedDict):
    """What words mean in a map. A robot acts on ``found`` only."""

    status: Literal["found", "ambiguous", "absent", "unparsed"]
    object_id: int | None
    room_id: int | None
    score: float
    candidates: list[Candidate]
    decided_by: str
    frame: str
    backend: str
    spoken: NotRequired[list[dict[str, Any]]]
    query: dict[str, Any] | None


class Part(TypedDict):
    """One of several commands that a step's sentence held."""

    command: str
    skill: str
    outcome: Outcome
    reason: str
    attempts: int
    start_s: float
    duration_s: float


class Step(TypedDict):
    """The account of one step."""

    index: int
    command: str
    skill: str
    outcome: Outcome
    reason: str
    start_s: float
    duration_s: float
    grounding: Grounding | None
    parts: NotRequired[list[Part]]
    path_length_m: float
    shortest_path_m: float | None
    spl: float | None


class Failure(TypedDict):
    """Where and why an episode failed."""

    step: int
    stage: Stage
    reason: str


class Expectation(TypedDict):
    """One expectation as the judge has it."""

    kind: str
    passed: bool
    measured: str
    required: str


class Metrics(TypedDict):
    """What the judge measured from ground truth."""

    sim_time_s: float
    path_length_m: float
    shortest_path_m: float | None
    spl: float | None
    soft_spl: float | None
    known_map_spl: float | None
    collisions: int
    others_touched: int
    min_clearance_m: float | None
    limit_violations: int
    contact_force_max_n: float
    person_contact_max_m_per_s: float | None
    non_target_displacement_max_m: float


class MapSize(TypedDict):
    """Size of the map at the end of a run."""

    objects: int
    relations: int
    rooms: int


class Summary(TypedDict):
    """The account of an episode, as in ``summary.json``."""

    schema: int
    episode: str
    scene: str
    robot: str
    physics: str
    perception: str
    seed: int
    success: bool
    failure: Failure | None
    steps: list[Step]
    expectations: list[Expectation]
    metrics: Metrics
    map: MapSize
    truth: dict[str, Any]


class Attributes(TypedDict):
    """What an object is like: the winners of all votes."""

    appearance: dict[str, str]
    physical: dict[str, str]
    affordance: dict[str, list[str]]


class MapObject(TypedDict):
    """One object of a map: world frame, metres."""

    id: int
    name: str
    center: list[float]
    size: list[float]
    quat_wxyz: list[float]
    attributes: Attributes
    room: str | None
    observations: int
    confidence: float


# `from` is a keyword of Python.
Relation = TypedDict("Relation", {"from": int, "to": int, "kind": str, "confidence": float})
"""What the object ``from`` is to the object ``to``."""


class Room(TypedDict):
    """One room of a map: world frame, metres."""

    id: int
    name: str
    polygon: list[list[float]]


class RobotState(TypedDict):
    """All that the robot feels at one moment. Poses are (4, 4) and what the robot believes, not what is true."""

    time_s: float
    base_velocity: NDArray[np.float64]
    """Forward speed and turning rate."""
    world_from_base: NDArray[np.float64]
    odom_from_base: NDArray[np.float64]
    base_from_tool: NDArray[np.float64]
    arm_positions: NDArray[np.float64]
    arm_velocities: NDArray[np.float64]
    head_positions: NDArray[np.float64]
    gripper_width_m: float
    gripper_force_n: float
