"""The compiled half of the package; import its names from :mod:`dsm`."""

from collections.abc import Mapping, Sequence
from os import PathLike
from types import TracebackType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from typing_extensions import Self

from dsm.protocols import Detector, Driver, Language
from dsm.types import (
    Expectation,
    Grounding,
    MapObject,
    Relation,
    RobotState,
    Room,
    Step,
    Summary,
)

__version__: str
CHECKOUT: str
"""The checkout that this module was built from: robots and scenes that ship with the program are found there."""

class Error(Exception):
    """What can go wrong outside a task; base of all errors of `dsm`."""

class InputError(Error):
    """Bad input, or a part that is not built in; the text names file, line and what was expected."""

class RunError(Error):
    """A driver failed, the emergency stop is latched, or the program contradicts itself."""

def main(words: Sequence[str]) -> int:
    """Runs the whole command line, as ``python -m dsm`` does, and gives the process exit code.

    It starts the log on stderr, may catch Ctrl-C and sets the number of worker threads: call it once per process.
    """

def run_episode(
    path: str | PathLike[str],
    *,
    seed: int | None = None,
    out: str | PathLike[str] | None = None,
    force: bool = False,
    robot: str | None = None,
    physics: Literal["rapier", "mujoco"] | str | None = None,
    perception: Literal["noisy", "oracle", "pixels"] | str | None = None,
    backend: str | None = None,
    threads: int | None = None,
    time_limit_s: float | None = None,
    detector: Detector | None = None,
    language: Language | None = None,
) -> Summary:
    """Runs one episode as ``dsm run`` does and gives its summary, as in ``summary.json``.

    ``out`` is the folder for ``summary.json``, ``timing.json``, ``map.dsm`` and ``report.html``; without it nothing is
    written. A folder that is not empty is an error unless ``force``. What is not given comes from the environment
    (``DSM_SEED`` and so on), then from the episode, then from the defaults, as on the command line. ``threads`` is set
    once per process and never changes a result. A task that fails is no error: see ``summary["failure"]``.

    Other Python threads go on meanwhile. Ctrl-C stops the robot, writes what there is and raises KeyboardInterrupt.
    """

class Frame:
    """Colour and aligned depth of one camera at one moment. It never changes."""

    def __init__(
        self,
        color: NDArray[np.uint8],
        depth: NDArray[np.float32],
        intrinsics: NDArray[np.float64],
        world_from_camera: NDArray[np.float64],
        *,
        stamp_s: float = 0.0,
        camera: str = "head",
        id: int = 0,
    ) -> None:
        """A frame from arrays, which are copied.

        ``color`` is (height, width, 3), ``depth`` (height, width) in metres, ``intrinsics`` (3, 3) in pixels and
        ``world_from_camera`` (4, 4); the camera looks along +z, x is right and y is down.
        """

    @property
    def id(self) -> int:
        """Number of the frame within a run."""

    @property
    def stamp_s(self) -> float:
        """When the picture was taken, seconds from the run's start."""

    @property
    def camera(self) -> str:
        """Name of the camera."""

    @property
    def color(self) -> NDArray[np.uint8]:
        """Colour, sRGB, (height, width, 3); it shares the frame's memory and cannot be written."""

    @property
    def depth(self) -> NDArray[np.float32]:
        """Depth along the camera's z in metres, (height, width), 0 where nothing came back; shared, not writable."""

    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """Intrinsics (3, 3) in pixels; the centre of the first pixel is at (0.5, 0.5)."""

    @property
    def world_from_camera(self) -> NDArray[np.float64]:
        """Where the camera was, as far as the robot knows: (4, 4)."""

class Detection:
    """One thing that a detector saw. It carries no identity: the map finds out what is the same thing."""

    def __init__(self, mask: NDArray[np.bool_], name: str, score: float = 1.0) -> None:
        """``mask`` is true where the thing is seen, as large as the frame; ``name`` is in open vocabulary."""

    @property
    def mask(self) -> NDArray[np.bool_]:
        """Its visible pixels, (height, width); a copy."""

    @property
    def name(self) -> str:
        """Its name, lower case."""

    @property
    def score(self) -> float:
        """Confidence, 0 to 1."""

class Map:
    """A Diverse Semantic Map as it was at one moment."""

    @staticmethod
    def open(path: str | PathLike[str]) -> Map:
        """Opens a map file. Of a damaged one whatever is whole is read, and a warning says what is not."""

    def save(self, path: str | PathLike[str]) -> None:
        """Saves the map; the file appears whole or not at all."""

    @property
    def objects(self) -> list[MapObject]:
        """Stable objects, as ``dsm map show --json`` lists them."""

    @property
    def relations(self) -> list[Relation]:
        """Relations between stable objects."""

    @property
    def rooms(self) -> list[Room]:
        """Rooms."""

    def ground(
        self,
        text: str,
        *,
        world_from_viewer: NDArray[np.float64] | None = None,
        backend: str | None = None,
        language: Language | None = None,
    ) -> Grounding:
        """What the words mean in this map.

        ``world_from_viewer`` (4, 4) is where left, right and nearest are seen from. Words that name nothing, or several
        things, are no error: see ``status``. Without ``backend`` and ``language`` those of the session answer.
        """

class MapBuilder:
    """Builds a map from frames with poses and what was detected in them, without a robot."""

    def __init__(self, *, detector: str = "detector") -> None:
        """Begins an empty map. ``detector`` names who detects: the map keeps it with the votes."""

    def observe(self, frame: Frame, detections: Sequence[Detection]) -> None:
        """Takes in a frame and what was detected in it. Frames come in the order of their stamps."""

    @property
    def map(self) -> Map:
        """The map so far."""

class World:
    """A scene with a robot in it that does what it is told, tick by tick. No map is built."""

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        seed: int | None = None,
        robot: str | None = None,
        physics: str | None = None,
        perception: str | None = None,
        start: tuple[float, float, float] | None = None,
        expect: Sequence[Mapping[str, Any]] | None = None,
    ) -> None:
        """Loads a scene (its folder or MJCF file) or the scene of an episode file, and puts the robot in.

        ``start`` is x_m, y_m, yaw_rad; without it the seed draws one. ``expect`` is what the judge looks for, as the
        ``[[expect]]`` tables of an episode file.
        """

    def step(
        self,
        *,
        base: tuple[float, float] = (0.0, 0.0),
        arm: Sequence[float] | NDArray[np.float64] | None = None,
        tool: Sequence[float] | NDArray[np.float64] | None = None,
        head: tuple[float, float] = (0.0, 0.0),
        gripper: tuple[float, float] | None = None,
        duration_s: float = 0.01,
    ) -> None:
        """Commands the robot for a while and lets time pass, ten milliseconds at a time.

        ``base`` is forward speed and turning rate; ``arm`` the velocities of ``arm_joints``, or ``tool`` the velocity of
        the tool in the base frame, linear then angular; ``head`` the velocities of ``head_joints``; ``gripper`` the
        width in metres and the greatest force in newtons. All is held to the robot's limits, and the base stops before
        what the cameras measured: read them as you drive. What is not commanded does not move.
        """

    def read(self, camera: str = "head") -> Frame | None:
        """The newest picture that was not read yet, rendered by this call; None when there is no new one."""

    def state(self) -> RobotState:
        """All that the robot feels. Poses are what it believes, not what is true."""

    def judge(self) -> list[Expectation]:
        """What the judge says of the expectations at this moment."""

    def stop(self, reason: str) -> None:
        """Stops the robot; it stays stopped."""

    @property
    def time_s(self) -> float:
        """Simulated seconds since the world was built."""

    @property
    def seed(self) -> int:
        """The seed of every draw."""

    @property
    def commands(self) -> list[str]:
        """The commands of the episode file, in order; empty for a scene."""

    @property
    def arm_joints(self) -> list[str]:
        """Names of the arm's joints, the lift first."""

    @property
    def head_joints(self) -> list[str]:
        """Names of the head's joints."""

    @property
    def cameras(self) -> list[str]:
        """Names of the cameras."""

    @property
    def limits(self) -> dict[str, float]:
        """Greatest speeds of the base, greatest width and force of the gripper, by name with unit."""

class Session:
    """A run that goes on: the robot with its senses, its map and its skills.

    Used as a context manager it finishes in the end.
    """

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        seed: int | None = None,
        robot: str | None = None,
        physics: str | None = None,
        perception: str | None = None,
        start: tuple[float, float, float] | None = None,
        expect: Sequence[Mapping[str, Any]] | None = None,
        time_limit_s: float | None = None,
        backend: str | None = None,
        detector: Detector | None = None,
        language: Language | None = None,
        driver: Driver | None = None,
        map_file: str | PathLike[str] | None = None,
    ) -> None:
        """Begins a run in a scene (its folder or MJCF file) or in that of an episode file, whose steps are not run.

        ``detector``, ``language`` and ``driver`` are objects of your own; with a driver neither scene nor judge are
        there, and what the robot sees is found in pixels alone unless there is a detector. The map is logged to
        ``map_file`` while it grows.
        """

    def run(self, command: str) -> Step:
        """Runs a command in English and accounts for it. After a step that failed the rest is skipped until `forgive`."""

    def explore(self) -> Step:
        """Sees all that can be reached."""

    def navigate(self, target: str) -> Step:
        """Drives to an object or a room, named in words."""

    def grasp(self, target: str) -> Step:
        """Drives to an object, named in words, and lifts it."""

    def forgive(self) -> None:
        """Forgets that a step failed: what comes next is begun all the same. The accounts stay."""

    def step(
        self,
        *,
        base: tuple[float, float] = (0.0, 0.0),
        arm: Sequence[float] | NDArray[np.float64] | None = None,
        gripper: tuple[float, float] | None = None,
        duration_s: float = 0.01,
    ) -> None:
        """Moves base, arm and gripper for a while, as a skill of your own; the head looks around and the map grows."""

    def frame(self, camera: str = "head") -> Frame | None:
        """The newest picture of a camera, None before the first. The head's camera is always read."""

    def state(self) -> RobotState:
        """All that the robot feels. Poses are what it believes, not what is true."""

    def judge(self) -> list[Expectation]:
        """What the judge says of the expectations at this moment; empty where nobody judges."""

    def finish(self) -> Summary:
        """Ends the run, lets things come to rest under the eyes of the judge, and gives the summary."""

    @property
    def map(self) -> Map:
        """The map as it is known at this moment, or at the end."""

    @property
    def time_s(self) -> float:
        """Simulated seconds since the run began."""

    @property
    def seed(self) -> int:
        """The seed of every draw."""

    @property
    def commands(self) -> list[str]:
        """The commands of the episode file, in order; empty for a scene."""

    def __enter__(self) -> Self: ...
    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...

class Recording:
    """A recording that ``dsm run --record`` has written. Its numbers are read at once, its frames when they are asked for."""

    def __init__(self, path: str | PathLike[str]) -> None:
        """Opens a recording and reads its numbers. Raises `InputError`: it is damaged, or no recording."""

    @property
    def head(self) -> dict[str, Any]:
        """Episode, robot, seed and all else that is needed to run again."""

    @property
    def end(self) -> dict[str, Any] | None:
        """How the run ended as the robot itself knows it; None when the recording breaks off before."""

    @property
    def columns(self) -> list[str]:
        """Names of the table's columns, as `dsm_tasks::replay::Table` lists them."""

    @property
    def table(self) -> NDArray[np.float64]:
        """What was measured and sent, (periods, columns), NaN where nobody asked."""

    def frames(self, camera: str | None = None) -> RecordedFrames:
        """The frames in the order in which they were read, one at a time; of one camera when it is named."""

class RecordedFrames:
    """Frames on their way out of a recording."""

    def __iter__(self) -> Self: ...
    def __next__(self) -> Frame: ...
