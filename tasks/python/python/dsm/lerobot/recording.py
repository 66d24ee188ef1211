"""A recorded run as an episode of a dataset: sampled at a fixed rate, with words for what was being done.

| feature | at frame k, t = begin + k / fps |
|---|---|
| `observation.state` | what was measured last at t: base in the world, its velocity, joint positions, gripper width |
| `action` | what was sent from t to the next frame: mean velocities of base and joints, the last width of the gripper |
| `observation.images.CAMERA` | the newest image of the camera at t |
| task | the command of the step at t |

Velocities hold until the next command, at most 0.5 s, after which a driver stops by itself; a width holds for good.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsm.lerobot.layout import DatasetError
from dsm.lerobot.writer import Episode, Image, Shape

DRIVER_TIMEOUT_S = 0.5
"""After so long without a command a driver stops by itself."""

ROUNDING_S = 1e-6
"""Moments that differ by less are one."""

BASE = ("base.x_m", "base.y_m", "base.yaw_rad", "base.forward_m_per_s", "base.turn_rad_per_s")


@dataclass(frozen=True)
class Sight:
    """When each camera's images were taken, in their order."""

    stamps_s: dict[str, NDArray[np.float64]]
    sizes: dict[str, tuple[int, int]]


class Run:
    """A recording that becomes an episode."""

    def __init__(self, path: Path, cameras: tuple[str, ...]) -> None:
        """Raises `dsm.Error` for a damaged recording and `DatasetError` when a camera has no image in it."""
        from dsm import Recording

        self.path = path
        self.recording = Recording(path)
        self.head: dict[str, Any] = self.recording.head
        self.end: dict[str, Any] | None = self.recording.end
        self.table: NDArray[np.float64] = self.recording.table
        self.column = {name: number for number, name in enumerate(self.recording.columns)}
        self.sight = self.look(cameras)

    def look(self, cameras: tuple[str, ...]) -> Sight:
        """Reads when images were taken."""
        stamps: dict[str, list[float]] = {}
        sizes: dict[str, tuple[int, int]] = {}
        for frame in self.recording.frames():
            stamps.setdefault(frame.camera, []).append(frame.stamp_s)
            height, width, _ = frame.color.shape
            sizes[frame.camera] = (height, width)
        if missing := [camera for camera in cameras if camera not in stamps]:
            raise DatasetError(f"{self.path}: no image of camera {missing}; it has images of {sorted(stamps)}")
        return Sight(
            {camera: np.array(stamps[camera]) for camera in cameras}, {camera: sizes[camera] for camera in cameras}
        )

    @property
    def joints(self) -> list[str]:
        """Joints of arm and head."""
        return [*self.head["arm_joints"], *self.head["head_joints"]]

    def guess_fps(self) -> int:
        """How often the first camera takes images, a second."""
        stamps = next(iter(self.sight.stamps_s.values()))
        if len(stamps) < 2:
            raise DatasetError(f"{self.path}: expected two images or more, got {len(stamps)}; or give --fps")
        return max(1, round(1.0 / float(np.median(np.diff(stamps)))))

    def shape(self, fps: int | None) -> Shape:
        """What a dataset of such runs has in common."""
        state = (*BASE, *(f"{joint}.position" for joint in self.joints), "gripper.width_m")
        action = (
            "base.forward_m_per_s",
            "base.turn_rad_per_s",
            *(f"{joint}.velocity" for joint in self.joints),
            "gripper.width_m",
        )
        return Shape(self.head["robot"], fps or self.guess_fps(), state, action, dict(self.sight.sizes))

    def episode(self, shape: Shape, verdicts: dict[tuple[str, int], bool]) -> Episode:
        """Samples the run. `verdicts` say whether a run succeeded, by episode and seed."""
        begin_s = max(float(stamps[0]) for stamps in self.sight.stamps_s.values())
        end_s = float(self.table[-1, self.column["now_s"]])
        frames = int((end_s - begin_s) * shape.fps + ROUNDING_S)
        if frames < 1:
            raise DatasetError(
                f"{self.path}: expected at least one frame of 1/{shape.fps} s, got {end_s - begin_s:.3f} s"
            )
        at_s = begin_s + np.arange(frames + 1) / shape.fps
        state = self.measured(shape.state, at_s[:-1])
        action = self.sent(shape.action, at_s)
        images = {camera: self.images(camera, at_s[:-1]) for camera in shape.cameras}
        return Episode(state, action, self.tasks(at_s[:-1]), images, self.about(verdicts))

    def measured(self, names: tuple[str, ...], at_s: NDArray[np.float64]) -> NDArray[np.float32]:
        """What was measured last at each moment; before the first reading, what that gave."""
        now_s = self.table[:, self.column["now_s"]]
        row = np.searchsorted(now_s, at_s + ROUNDING_S, side="right") - 1
        columns = []
        for name in names:
            values = self.table[:, self.column[name]]
            known = np.flatnonzero(np.isfinite(values))
            if known.size == 0:
                raise DatasetError(f"{self.path}: {name} was never measured")
            last = np.searchsorted(known, row, side="right") - 1
            columns.append(values[known[np.maximum(last, 0)]])
        return np.stack(columns, axis=1).astype(np.float32)

    def sent(self, names: tuple[str, ...], at_s: NDArray[np.float64]) -> NDArray[np.float32]:
        """What was sent from each moment to the next."""
        now_s = self.table[:, self.column["now_s"]]
        bounds = np.searchsorted(now_s, at_s - ROUNDING_S)
        columns = []
        for name in names:
            values = self.table[:, self.column[f"sent.{name}"]]
            if name == "gripper.width_m":
                columns.append(self.held_width(values)[np.maximum(bounds[1:] - 1, 0)])
            else:
                sums = np.concatenate([[0.0], np.cumsum(held_velocity(values, now_s))])
                columns.append((sums[bounds[1:]] - sums[bounds[:-1]]) / np.maximum(np.diff(bounds), 1))
        return np.stack(columns, axis=1).astype(np.float32)

    def held_width(self, sent: NDArray[np.float64]) -> NDArray[np.float64]:
        """The width that the gripper is to have in each period: as sent, before that as measured."""
        measured = self.table[:, self.column["gripper.width_m"]]
        known = measured[np.isfinite(measured)]
        return fill_forward(sent, float(known[0]) if known.size else 0.0)

    def tasks(self, at_s: NDArray[np.float64]) -> list[str]:
        """The command of the step at each moment; between steps that of the next one."""
        steps = (self.end or {}).get("steps") or []
        if not steps:
            return [str(self.head["episode"]["step"][0]["command"])] * len(at_s)
        ends = np.array([step["start_s"] + step["duration_s"] for step in steps])
        number = np.minimum(np.searchsorted(ends, at_s, side="right"), len(steps) - 1)
        return [str(steps[place]["command"]) for place in number]

    def images(self, camera: str, at_s: NDArray[np.float64]) -> Iterator[Image]:
        """The newest image at each moment."""
        stamps = self.sight.stamps_s[camera]
        wanted = np.searchsorted(stamps, at_s + ROUNDING_S, side="right") - 1
        place = 0
        for number, frame in enumerate(self.recording.frames(camera)):
            while place < len(wanted) and wanted[place] == number:
                yield frame.color
                place += 1
            if place == len(wanted):
                return

    def about(self, verdicts: dict[tuple[str, int], bool]) -> dict[str, Any]:
        """What the dataset tells of the episode beside the format's own columns."""
        succeeded = verdicts.get((self.head["name"], self.head["seed"]))
        failure = (self.end or {}).get("failure") or {}
        return {
            "dsm/episode": self.head["name"],
            "dsm/seed": self.head["seed"],
            "dsm/physics": self.head["physics"],
            "dsm/perception": self.head["perception"],
            "dsm/whole": self.end is not None,
            "dsm/robot_says": str(failure.get("reason", "done")) if self.end is not None else "",
            "dsm/judge_says": "not judged" if succeeded is None else "success" if succeeded else "failure",
        }


def held_velocity(sent: NDArray[np.float64], now_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """The velocity in each period: as sent last, 0 before the first command and when the last one is too old."""
    number = np.arange(len(sent))
    last = np.maximum.accumulate(np.where(np.isfinite(sent), number, -1))
    fresh = (last >= 0) & (now_s - now_s[np.maximum(last, 0)] < DRIVER_TIMEOUT_S)
    return np.where(fresh, sent[np.maximum(last, 0)], 0.0)


def fill_forward(values: NDArray[np.float64], first: float) -> NDArray[np.float64]:
    """Each unknown value becomes the last known one, `first` before any."""
    last = np.maximum.accumulate(np.where(np.isfinite(values), np.arange(len(values)), -1))
    return np.where(last >= 0, values[np.maximum(last, 0)], first)


def read_verdicts(summaries: list[str | PathLike[str]]) -> dict[tuple[str, int], bool]:
    """Which runs the judge saw succeed, from their `summary.json`."""
    verdicts = {}
    for path in summaries:
        try:
            summary = json.loads(Path(path).read_text())
            verdicts[summary["episode"], summary["seed"]] = bool(summary["success"])
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise DatasetError(f"{path}: expected a summary.json of a run: {error!r}") from error
    return verdicts
