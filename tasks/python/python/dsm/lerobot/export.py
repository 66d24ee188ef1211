"""From recordings to a dataset."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from dsm.lerobot.layout import DatasetError
from dsm.lerobot.recording import Run, read_verdicts
from dsm.lerobot.writer import DatasetWriter


def export_runs(
    recordings: Sequence[str | PathLike[str]],
    out: str | PathLike[str],
    *,
    cameras: Sequence[str] = ("head",),
    fps: int | None = None,
    summaries: Sequence[str | PathLike[str]] = (),
) -> Path:
    """Writes recordings of `dsm run --record` as a LeRobotDataset v3.0, an episode each, in the order given.

    `fps` is how many frames a second it has, by default as many as the first camera takes. `summaries` are files
    `summary.json` of the same runs, which tell whether they succeeded: a recording itself holds no truth.

    Raises `DatasetError`: the runs do not fit each other, or the folder is not empty; `dsm.Error`: damage.
    """
    if not recordings:
        raise DatasetError("expected at least one recording")
    verdicts = read_verdicts(list(summaries))
    first = Run(Path(recordings[0]), tuple(cameras))
    shape = first.shape(fps)
    with DatasetWriter(Path(out), shape) as writer:
        for number, path in enumerate(recordings):
            run = first if number == 0 else Run(Path(path), tuple(cameras))
            if (own := run.shape(shape.fps)) != shape:
                raise DatasetError(
                    f"{path}: expected the robot, joints and images of {recordings[0]}: {shape}, got {own}"
                )
            writer.put(run.episode(shape, verdicts))
    return Path(out)
