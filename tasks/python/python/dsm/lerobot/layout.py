"""Where LeRobotDataset v3.0 keeps what, and which columns every dataset has."""

from __future__ import annotations

from pathlib import Path
from typing import Any

VERSION = "v3.0"
"""The version of the format that is written and checked."""

INFO = "meta/info.json"
STATS = "meta/stats.json"
TASKS = "meta/tasks.parquet"
EPISODES = "meta/episodes/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
DATA = "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet"
VIDEO = "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4"

FILES_IN_A_CHUNK = 1000
DATA_FILE_MB = 100
VIDEO_FILE_MB = 200

OWN_FEATURES: dict[str, dict[str, Any]] = {
    "timestamp": {"dtype": "float32", "shape": [1], "names": None},
    "frame_index": {"dtype": "int64", "shape": [1], "names": None},
    "episode_index": {"dtype": "int64", "shape": [1], "names": None},
    "index": {"dtype": "int64", "shape": [1], "names": None},
    "task_index": {"dtype": "int64", "shape": [1], "names": None},
}
"""What the format itself asks for, beside what a robot brings."""

QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
"""Names in the statistics."""

TASK_COLUMN = "__index_level_0__"
"""The column of the texts in `tasks.parquet`, which pandas reads back as the index."""


class DatasetError(Exception):
    """A dataset cannot be written or read, and why."""


def next_place(place: tuple[int, int], files_in_a_chunk: int) -> tuple[int, int]:
    """The chunk and file after these."""
    chunk, file = place
    return (chunk + 1, 0) if file + 1 >= files_in_a_chunk else (chunk, file + 1)


def list_parquet(folder: Path) -> list[Path]:
    """The Parquet files of all chunks below a folder, in their order."""
    return sorted(folder.glob("chunk-*/file-*.parquet"))
