"""Checks the Parquet files and statistics of a LeRobotDataset v3.0."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from dsm.lerobot import layout
from dsm.lerobot.check import NUMBERS, Dataset, is_whole

TIME_TOLERANCE_S = 1e-4
"""How far a stamp may lie from its frame, as LeRobot's loader has it."""


def read_table(dataset: Dataset, path: Path) -> Any:
    """A Parquet file; `None` and a finding when it cannot be read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    name = str(path.relative_to(dataset.folder))
    try:
        return pq.ParquetFile(path).read()
    except FileNotFoundError:
        dataset.find(name, "expected this file")
    except (pa.ArrowException, OSError) as error:
        dataset.find(name, f"expected a Parquet file: {error}")
    return None


def check_tasks(dataset: Dataset) -> None:
    """`meta/tasks.parquet`: a text for each `task_index` from 0."""
    table = read_table(dataset, dataset.folder / layout.TASKS)
    if table is None:
        return
    texts = [name for name in table.column_names if name != "task_index"]
    if "task_index" not in table.column_names or len(texts) != 1:
        dataset.find(layout.TASKS, f"expected the columns task_index and one with the texts, got {table.column_names}")
        return
    numbers, tasks = table["task_index"].to_pylist(), table[texts[0]].to_pylist()
    if numbers != list(range(len(numbers))):
        dataset.find(layout.TASKS, f"task_index: expected 0 to {len(numbers) - 1} in order, got {numbers[:8]}")
    if len(set(tasks)) != len(tasks) or not all(isinstance(task, str) and task for task in tasks):
        dataset.find(layout.TASKS, "expected texts that are not empty and differ from each other")
    if len(tasks) != dataset.info["total_tasks"]:
        dataset.find(
            layout.TASKS, f"expected {dataset.info['total_tasks']} tasks as {layout.INFO} says, got {len(tasks)}"
        )
    dataset.tasks = tasks


def check_episodes(dataset: Dataset) -> None:
    """`meta/episodes`: episodes from 0 without gaps, frames from 0 without gaps."""
    wanted = ["episode_index", "tasks", "length", "dataset_from_index", "dataset_to_index"]
    wanted += ["data/chunk_index", "data/file_index", "meta/episodes/chunk_index", "meta/episodes/file_index"]
    parts = ("chunk_index", "file_index", "from_timestamp", "to_timestamp")
    wanted += [f"videos/{key}/{part}" for key in dataset.video_keys for part in parts]
    paths = layout.list_parquet(dataset.folder / "meta/episodes")
    if not paths:
        dataset.find("meta/episodes", "expected chunk-000/file-000.parquet")
    for path in paths:
        name = str(path.relative_to(dataset.folder))
        table = read_table(dataset, path)
        if table is None:
            continue
        missing = [column for column in wanted if column not in table.column_names]
        if missing:
            dataset.find(name, f"expected the columns {missing}")
            continue
        for row in table.select(wanted).to_pylist():
            check_episode(dataset, name, row)
    if (found := len(dataset.episodes)) != dataset.info["total_episodes"]:
        dataset.find(
            "meta/episodes", f"expected {dataset.info['total_episodes']} episodes as {layout.INFO} says, got {found}"
        )
    end = dataset.episodes[-1]["dataset_to_index"] if dataset.episodes else 0
    if end != dataset.info["total_frames"]:
        dataset.find(
            "meta/episodes", f"expected {dataset.info['total_frames']} frames as {layout.INFO} says, got {end}"
        )


def check_episode(dataset: Dataset, name: str, row: dict[str, Any]) -> None:
    """One episode against the one before."""
    number = len(dataset.episodes)
    where = f"episode {number}"
    if empty := [column for column, value in row.items() if value is None]:
        dataset.find(name, f"{where}: expected values of {empty}")
        return
    if row["episode_index"] != number:
        dataset.find(name, f"{where}: episode_index: expected {number}, got {row['episode_index']}")
    begin = dataset.episodes[-1]["dataset_to_index"] if dataset.episodes else 0
    if row["dataset_from_index"] != begin:
        dataset.find(name, f"{where}: dataset_from_index: expected {begin}, got {row['dataset_from_index']}")
    if not 0 < row["length"] == row["dataset_to_index"] - row["dataset_from_index"]:
        dataset.find(
            name,
            f"{where}: length: expected dataset_to_index - dataset_from_index, above 0, got {row['length']}",
        )
    own = layout.EPISODES.format(
        chunk_index=row["meta/episodes/chunk_index"], file_index=row["meta/episodes/file_index"]
    )
    if own != name:
        dataset.find(name, f"{where}: meta/episodes: says that it stands in {own}")
    if unknown := [task for task in row["tasks"] if task not in dataset.tasks]:
        dataset.find(name, f"{where}: tasks: {unknown} are not in {layout.TASKS}")
    chunks = dataset.info["chunks_size"]
    if late := [column for column, value in row.items() if column.endswith("file_index") and not 0 <= value < chunks]:
        dataset.find(name, f"{where}: expected less than chunks_size = {chunks} in {late}")
    dataset.episodes.append(row)


def check_data(dataset: Dataset) -> None:
    """`data`: a row for each frame, in files that episodes name."""
    named: dict[str, list[dict[str, Any]]] = {}
    for row in dataset.episodes:
        place = {"chunk_index": row["data/chunk_index"], "file_index": row["data/file_index"]}
        named.setdefault(dataset.info["data_path"].format(**place), []).append(row)
    for path in layout.list_parquet(dataset.folder / "data"):
        if (name := str(path.relative_to(dataset.folder))) not in named:
            dataset.find(name, "is named by no episode")
    for name, rows in named.items():
        table = read_table(dataset, dataset.folder / name)
        if table is None or not check_columns(dataset, name, table):
            continue
        if table.num_rows != (expected := sum(row["length"] for row in rows)):
            dataset.find(name, f"expected {expected} rows for {len(rows)} episodes, got {table.num_rows}")
            continue
        begin = 0
        for row in rows:
            check_rows(dataset, name, row, table.slice(begin, row["length"]))
            begin += row["length"]


def check_columns(dataset: Dataset, name: str, table: Any) -> bool:
    """Columns and their types against the features."""
    import pyarrow as pa

    features = {key: feature for key, feature in dataset.info["features"].items() if feature["dtype"] != "video"}
    before = len(dataset.findings)
    if set(table.column_names) != set(features):
        missing, more = set(features) - set(table.column_names), set(table.column_names) - set(features)
        dataset.find(
            name, f"expected the columns of {layout.INFO}: missing {sorted(missing)}, not expected {sorted(more)}"
        )
        return False
    for key, feature in features.items():
        kind, column = feature["dtype"], table.schema.field(key).type
        depth = 0 if feature["shape"] == [1] else len(feature["shape"])
        inner = column
        while pa.types.is_list(inner) or pa.types.is_fixed_size_list(inner):
            inner, depth = inner.value_type, depth - 1
        arrow = {"float32": "float", "float64": "double"}.get(kind, kind)
        if kind in NUMBERS and (str(inner) != arrow or depth != 0):
            dataset.find(name, f"{key}: expected {kind} of shape {feature['shape']}, got {column}")
    return len(dataset.findings) == before


def check_rows(dataset: Dataset, name: str, row: dict[str, Any], table: Any) -> None:
    """The rows of one episode."""
    where = f"episode {row['episode_index']}"
    frame = np.arange(row["length"])
    column = {key: table[key].to_numpy() for key in layout.OWN_FEATURES}
    expected = {"frame_index": frame, "index": frame + row["dataset_from_index"],
                "episode_index": np.full(row["length"], row["episode_index"])}  # fmt: skip
    for key, values in expected.items():
        wrong = np.flatnonzero(column[key] != values)
        if wrong.size:
            at = int(wrong[0])
            dataset.find(name, f"{where}: {key}: row {at}: expected {values[at]}, got {column[key][at]}")
    late = np.flatnonzero(~(np.abs(column["timestamp"] - frame / dataset.info["fps"]) <= TIME_TOLERANCE_S))
    if late.size:
        at = int(late[0])
        dataset.find(
            name,
            f"{where}: timestamp: row {at}: expected {at / dataset.info['fps']:.4f} s,"
            f" got {column['timestamp'][at]:.4f} s",
        )
    numbers = set(column["task_index"].tolist())
    if not all(0 <= number < len(dataset.tasks) for number in numbers):
        dataset.find(name, f"{where}: task_index: expected 0 to {len(dataset.tasks) - 1}, got {sorted(numbers)}")
    elif {dataset.tasks[number] for number in numbers} != set(row["tasks"]):
        dataset.find(name, f"{where}: task_index: expected the tasks {row['tasks']}")
    for key, feature in dataset.info["features"].items():
        if feature["dtype"] in NUMBERS and feature["shape"] != [1] and len(feature["shape"]) == 1:
            check_vector(dataset, name, f"{where}: {key}", table[key], feature)


def check_vector(dataset: Dataset, name: str, where: str, column: Any, feature: dict[str, Any]) -> None:
    """A feature with several values in a frame."""
    sizes = {len(values) for values in column.to_pylist()}
    if sizes != {feature["shape"][0]}:
        dataset.find(name, f"{where}: expected {feature['shape'][0]} values in each row, got {sorted(sizes)}")
    elif not np.isfinite(np.asarray(column.to_pylist(), dtype=np.float64)).all():
        dataset.find(name, f"{where}: holds values that are not finite")


def check_stats(dataset: Dataset) -> None:
    """`meta/stats.json`: finite, in order, and of as many frames as there are."""
    path = dataset.folder / layout.STATS
    try:
        stats = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        dataset.find(layout.STATS, f"expected statistics as JSON: {error}")
        return
    for key, feature in dataset.info["features"].items():
        if feature["dtype"] == "string":
            continue
        found = stats.get(key, {})
        missing = [name for name in ("min", "max", "mean", "std", "count") if name not in found]
        if missing:
            dataset.find(layout.STATS, f"{key}: expected {missing}")
            continue
        low, mean, high, spread = (np.asarray(found[name], dtype=np.float64) for name in ("min", "mean", "max", "std"))
        shape = (3, 1, 1) if feature["dtype"] in ("video", "image") else tuple(feature["shape"])
        if {low.shape, mean.shape, high.shape, spread.shape} != {shape}:
            dataset.find(layout.STATS, f"{key}: expected values of shape {shape}, got {mean.shape}")
        elif not ((low <= mean + 1e-6).all() and (mean <= high + 1e-6).all() and (spread >= 0).all()):
            dataset.find(layout.STATS, f"{key}: expected min <= mean <= max and std >= 0")
        count = found["count"]
        frames = dataset.info["total_frames"]
        if not (isinstance(count, list) and len(count) == 1 and is_whole(count[0])):
            dataset.find(layout.STATS, f"{key}: count: expected one whole number in a list, got {count!r}")
        elif feature["dtype"] in NUMBERS and count[0] != frames:
            dataset.find(layout.STATS, f"{key}: count: expected {frames} frames, got {count[0]}")
