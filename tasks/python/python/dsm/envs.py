"""Gymnasium environments: ``dsm/FetchObject-v0``, ``dsm/NavigateTo-v0``, ``dsm/PlaceObject-v0``, ``dsm/Task-v0``.

>>> import gymnasium
>>> env = gymnasium.make("dsm/NavigateTo-v0")  # doctest: +SKIP
>>> observation, info = env.reset(seed=3)  # doctest: +SKIP

An observation is a dictionary of ``color``, ``depth``, ``proprioception`` and ``command``. An action is a velocity of
base, tool, head and fingers (``control="velocity"``), or one of the robot's skills (``control="skills"``). The judge
decides: an episode terminates when all that it expects holds, and the reward is the change of the share that holds.
"""

from __future__ import annotations

import string
from os import PathLike
from pathlib import Path
from typing import Any, Literal, TypedDict

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from dsm._dsm import Frame, InputError, RunError, Session, World
from dsm.registration import register_envs
from dsm.scenes import find_episode
from dsm.types import Expectation, RobotState

Observation = dict[str, Any]
Action = Any

FARTHEST_M = 20.0
"""Depths beyond this are cut off."""

TOOL_M_PER_S = 0.25
TOOL_RAD_PER_S = 1.0
HEAD_RAD_PER_S = 1.0
"""What an action of 1 means for the tool and the head; for the base it is the robot's own limit."""

VELOCITIES = (
    "forward",
    "turn",
    "tool_x",
    "tool_y",
    "tool_z",
    "tool_roll",
    "tool_pitch",
    "tool_yaw",
    "head_pan",
    "head_tilt",
    "gripper",
)
"""Meaning of the values of a velocity action: from -1 to 1, the gripper from closed to open."""

SKILLS = ("explore", "navigate", "grasp", "command")
"""Meaning of a skill action: see all, drive to the target, lift the target, do the whole command."""

LONGEST_COMMAND = 240


class _Options(TypedDict):
    perception: str | None
    physics: str | None
    robot: str | None


class TaskEnv(gymnasium.Env[Observation, Action]):
    """An episode file as an environment.

    ``episode`` is the file; ``command`` and ``target`` replace its first command and say what the skills act on;
    ``control`` is what actions are; ``stride`` thins the pictures, 1 gives every pixel; ``step_s`` is the length of a
    velocity action and ``time_limit_s`` that of an episode, both simulated.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}

    def __init__(
        self,
        episode: str | PathLike[str],
        *,
        command: str | None = None,
        target: str | None = None,
        control: Literal["velocity", "skills"] = "velocity",
        stride: int = 4,
        step_s: float = 0.2,
        time_limit_s: float = 240.0,
        perception: str | None = None,
        physics: str | None = None,
        robot: str | None = None,
        render_mode: str | None = None,
    ) -> None:
        if control not in ("velocity", "skills"):
            raise InputError(f"control is `{control}`; expected velocity or skills")
        if not (isinstance(stride, int) and 1 <= stride <= 16):
            raise InputError(f"stride is {stride}; expected 1 to 16")
        if not 0.05 <= step_s <= 10.0:
            raise InputError(f"step_s is {step_s}; expected 0.05 to 10")
        if render_mode not in (None, "rgb_array"):
            raise InputError(f"render_mode is `{render_mode}`; expected rgb_array or None")
        self.episode = Path(episode)
        self.control = control
        self.render_mode = render_mode
        self._options = _Options(perception=perception, physics=physics, robot=robot)
        self._stride, self._step_s, self._time_limit_s = stride, step_s, time_limit_s
        # What the spaces are depends on the robot: it is looked at once.
        world = World(self.episode, seed=0, **self._options)
        self._command = command or (world.commands or [""])[0]
        if not 0 < len(self._command) <= LONGEST_COMMAND:
            raise InputError(f"command has {len(self._command)} characters; expected 1 to {LONGEST_COMMAND}")
        self._target = target or target_of(self._command)
        self._limits = world.limits
        self._body: World | Session = world
        self._frame = self._first_frame()
        self._passed = 0.0
        rows, columns = self._frame.depth[::stride, ::stride].shape
        feelings = len(feelings_of(world.state()))
        self.observation_space = spaces.Dict(
            {
                "color": spaces.Box(0, 255, (rows, columns, 3), np.uint8),
                "depth": spaces.Box(0.0, FARTHEST_M, (rows, columns), np.float32),
                "proprioception": spaces.Box(-FARTHEST_FELT, FARTHEST_FELT, (feelings,), np.float32),
                "command": spaces.Text(LONGEST_COMMAND, charset=string.printable),
            }
        )
        if control == "velocity":
            self.action_space = spaces.Box(-1.0, 1.0, (len(VELOCITIES),), np.float32)
        else:
            self.action_space = spaces.Discrete(len(SKILLS))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Builds the world anew: with ``seed`` as the seed of ``dsm run``, without with one that is drawn."""
        super().reset(seed=seed)
        drawn = int(self.np_random.integers(2**31)) if seed is None else seed
        if self.control == "velocity":
            self._body = World(self.episode, seed=drawn, **self._options)
        else:
            limit_s = self._time_limit_s + 10.0
            self._body = Session(self.episode, seed=drawn, time_limit_s=limit_s, **self._options)
        self._frame = self._first_frame()
        expectations = self._body.judge()
        self._passed = share_of(expectations)
        return self._observation(), self._info(expectations)

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Acts for ``step_s``, or until the skill has ended."""
        told: dict[str, Any] = {}
        try:
            if isinstance(self._body, World):
                self._move(self._body, np.asarray(action, dtype=np.float64))
                self._look()
            else:
                told["step"] = self._act(self._body, SKILLS[int(action)])
                self._look()
        except RunError as error:
            # The robot was stopped, or its time is up: the world goes on, the episode does not.
            told["error"] = str(error)
        expectations = self._body.judge()
        passed = share_of(expectations)
        reward, self._passed = passed - self._passed, passed
        terminated = bool(expectations) and passed == 1.0
        truncated = not terminated and ("error" in told or self._body.time_s >= self._time_limit_s)
        return self._observation(), reward, terminated, truncated, self._info(expectations) | told

    def render(self) -> NDArray[np.uint8] | None:
        """What the head camera saw last, every pixel."""
        return self._frame.color if self.render_mode == "rgb_array" else None

    def _move(self, world: World, action: NDArray[np.float64]) -> None:
        value = dict(zip(VELOCITIES, (float(v) for v in np.clip(action, -1.0, 1.0)), strict=True))
        limits = self._limits
        linear = [TOOL_M_PER_S * value[f"tool_{axis}"] for axis in ("x", "y", "z")]
        angular = [TOOL_RAD_PER_S * value[f"tool_{axis}"] for axis in ("roll", "pitch", "yaw")]
        width_m = 0.5 * (1.0 + value["gripper"]) * limits["gripper_width_m"]
        moves_tool = any(linear) or any(angular)
        world.step(
            base=(
                value["forward"] * limits["base_forward_m_per_s"],
                value["turn"] * limits["base_turn_rad_per_s"],
            ),
            tool=linear + angular if moves_tool else None,
            head=(HEAD_RAD_PER_S * value["head_pan"], HEAD_RAD_PER_S * value["head_tilt"]),
            gripper=(width_m, limits["gripper_force_n"]),
            duration_s=self._step_s,
        )

    def _act(self, session: Session, skill: str) -> Any:
        session.forgive()
        if skill == "explore":
            return session.explore()
        if skill == "navigate":
            return session.navigate(self._target)
        if skill == "grasp":
            return session.grasp(self._target)
        return session.run(self._command)

    def _first_frame(self) -> Frame:
        for _ in range(100):
            frame = self._find_frame()
            if frame is not None:
                return frame
            self._body.step()
        raise RunError("no picture of the head camera came within a simulated second")

    def _find_frame(self) -> Frame | None:
        return self._body.read() if isinstance(self._body, World) else self._body.frame()

    def _look(self) -> None:
        self._frame = self._find_frame() or self._frame

    def _observation(self) -> Observation:
        stride = self._stride
        depth = np.minimum(self._frame.depth[::stride, ::stride], np.float32(FARTHEST_M))
        return {
            "color": np.ascontiguousarray(self._frame.color[::stride, ::stride]),
            "depth": depth,
            "proprioception": feelings_of(self._body.state()),
            "command": self._command,
        }

    def _info(self, expectations: list[Expectation]) -> dict[str, Any]:
        return {"expectations": expectations, "seed": self._body.seed, "time_s": self._body.time_s}


FARTHEST_FELT = 1000.0
"""What is felt beyond this is cut off; nothing in a home is."""


def feelings_of(state: RobotState) -> NDArray[np.float32]:
    """Proprioception in one row: speed and turning rate of the base; x, y and the heading's cosine and sine by odometry;
    the tool in the base frame; positions of arm and head; velocities of the arm; width and force of the fingers.
    """
    odom = state["odom_from_base"]
    row = np.concatenate(
        [
            state["base_velocity"],
            [odom[0, 3], odom[1, 3], odom[0, 0], odom[1, 0]],
            state["base_from_tool"][:3, 3],
            state["arm_positions"],
            state["head_positions"],
            state["arm_velocities"],
            [state["gripper_width_m"], state["gripper_force_n"]],
        ]
    )
    feelings: NDArray[np.float32] = np.clip(row, -FARTHEST_FELT, FARTHEST_FELT).astype(np.float32)
    return feelings


def share_of(expectations: list[Expectation]) -> float:
    """Share of the expectations that hold."""
    return sum(e["passed"] for e in expectations) / max(len(expectations), 1)


def target_of(command: str) -> str:
    """What a command acts on: from its first article on; the whole command without one."""
    words = command.split()
    starts = [i for i, word in enumerate(words) if word.lower() in ("the", "a", "an", "some", "any")]
    return " ".join(words[starts[0] :]) if starts else command


def make_shipped(episode: str, **options: Any) -> TaskEnv:
    """The environment of an episode that ships with the program, by name, or of an episode file."""
    file = Path(episode)
    return TaskEnv(file if file.suffix == ".toml" else find_episode(episode), **options)


register_envs()
