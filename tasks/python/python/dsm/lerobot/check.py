"""Checks a folder against the documented LeRobotDataset v3.0 format, without LeRobot.

Each finding names the file and says what was expected. One check builds on the other: tables are only looked into
when `info.json` holds, videos when the tables do.
"""

from __future__ import annotations

import json
import re
import sys
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any

from dsm.lerobot import layout
from dsm.lerobot.layout import DatasetError

NUMBERS = {"float32", "float64", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "bool"}
"""The `dtype` of features with numbers."""

KINDS = NUMBERS | {"video", "image", "string"}
"""Each `dtype` of a feature."""


@dataclass
class Dataset:
    """A dataset as far as it was read, and what is wrong with it."""

    folder: Path
    info: dict[str, Any] = field(default_factory=dict)
    tasks: list[str] = field(default_factory=list)
    episodes: list[dict[str, Any]] = field(default_factory=list)
    findings: list[str] = field(default_factory=list)

    def find(self, file: str, expected: str) -> None:
        """Notes that something is wrong."""
        self.findings.append(f"{file}: {expected}")

    @property
    def video_keys(self) -> list[str]:
        """The features that are videos."""
        return [key for key, feature in self.info["features"].items() if feature["dtype"] == "video"]


def check_dataset(folder: str | PathLike[str]) -> Dataset:
    """Reads a dataset and notes all that is wrong with it.

    Raises `DatasetError`: the folder holds no `meta/info.json`, so it is no dataset.
    """
    from dsm.lerobot.check_tables import check_data, check_episodes, check_stats, check_tasks
    from dsm.lerobot.check_videos import check_videos

    folder = Path(folder)
    dataset = Dataset(folder)
    if not (folder / layout.INFO).is_file():
        raise DatasetError(f"{folder}: is no LeRobotDataset: expected {layout.INFO}")
    for check in (check_info, check_tasks, check_episodes, check_data, check_stats, check_videos):
        if dataset.findings and check in (check_tasks, check_data):
            break
        check(dataset)
    return dataset


def check_info(dataset: Dataset) -> None:
    """`meta/info.json`: versions, totals, templates of paths, features."""
    try:
        info = json.loads((dataset.folder / layout.INFO).read_text())
    except ValueError as error:
        dataset.find(layout.INFO, f"expected JSON: {error}")
        return
    if not isinstance(info, dict):
        dataset.find(layout.INFO, "expected an object")
        return
    dataset.info = info
    version = info.get("codebase_version")
    if not (isinstance(version, str) and re.fullmatch(r"v3\.\d+", version)):
        dataset.find(layout.INFO, f"codebase_version: expected v3.0, got {version!r}")
    for name in ("total_episodes", "total_frames", "total_tasks", "chunks_size", "fps"):
        if not (is_whole(info.get(name)) and info[name] > 0):
            dataset.find(layout.INFO, f"{name}: expected a whole number above 0, got {info.get(name)!r}")
    for name in ("data_files_size_in_mb", "video_files_size_in_mb"):
        if not (is_number(info.get(name)) and info[name] > 0):
            dataset.find(layout.INFO, f"{name}: expected a number above 0, got {info.get(name)!r}")
    features = info.get("features")
    if not (isinstance(features, dict) and all(isinstance(feature, dict) for feature in features.values())):
        dataset.find(layout.INFO, "features: expected an object for each feature")
        return
    for name, feature in features.items():
        check_feature(dataset, name, feature)
    for name, own in layout.OWN_FEATURES.items():
        found = features.get(name, {})
        if (found.get("dtype"), found.get("shape")) != (own["dtype"], own["shape"]):
            dataset.find(layout.INFO, f"features: {name}: expected {own['dtype']} of shape {own['shape']}")
    has_video = any(feature.get("dtype") == "video" for feature in features.values())
    check_template(dataset, "data_path", ("chunk_index", "file_index"))
    if has_video:
        check_template(dataset, "video_path", ("video_key", "chunk_index", "file_index"))
    check_splits(dataset)


def is_whole(value: Any) -> bool:
    """Whether it is a whole number, and no truth value."""
    return isinstance(value, int) and not isinstance(value, bool)


def is_number(value: Any) -> bool:
    """Whether it is a number, and no truth value."""
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def check_feature(dataset: Dataset, name: str, feature: dict[str, Any]) -> None:
    """`dtype`, `shape` and `names` of a feature."""
    where = f"features: {name}"
    if "/" in name:
        dataset.find(layout.INFO, f"{where}: a name may not hold `/`")
    kind, shape = feature.get("dtype"), feature.get("shape")
    if kind not in KINDS:
        dataset.find(layout.INFO, f"{where}: dtype: expected one of {sorted(KINDS)}, got {kind!r}")
    if not (isinstance(shape, list) and shape and all(is_whole(size) and size > 0 for size in shape)):
        dataset.find(layout.INFO, f"{where}: shape: expected whole numbers above 0, got {shape!r}")
        return
    names = feature.get("names")
    if kind in NUMBERS and isinstance(names, list) and len(shape) == 1 and len(names) != shape[0]:
        dataset.find(layout.INFO, f"{where}: names: expected {shape[0]} as its shape says, got {len(names)}")
    if kind in ("video", "image") and not (len(shape) == 3 and (shape[2] in (1, 3) or shape[0] in (1, 3))):
        dataset.find(layout.INFO, f"{where}: shape: expected height, width and channels, got {shape}")


def check_template(dataset: Dataset, name: str, keys: tuple[str, ...]) -> None:
    """A template of paths."""
    template = dataset.info.get(name)
    missing = [key for key in keys if not (isinstance(template, str) and re.search(r"\{" + key + r"[:}]", template))]
    if missing:
        dataset.find(layout.INFO, f"{name}: expected a path with {{{'}, {'.join(missing)}}}, got {template!r}")


def check_splits(dataset: Dataset) -> None:
    """The splits, which are ranges of episodes."""
    splits = dataset.info.get("splits")
    if not isinstance(splits, dict):
        dataset.find(layout.INFO, f"splits: expected an object, got {splits!r}")
        return
    total = dataset.info.get("total_episodes")
    last = total if isinstance(total, int) else sys.maxsize
    for name, text in splits.items():
        parts = re.fullmatch(r"(\d+):(\d+)", text) if isinstance(text, str) else None
        if parts is None or not int(parts[1]) <= int(parts[2]) <= last:
            dataset.find(layout.INFO, f"splits: {name}: expected FROM:TO within {total} episodes, got {text!r}")
