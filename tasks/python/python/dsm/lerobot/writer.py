"""Writes a LeRobotDataset v3.0, episode by episode.

```text
episode ──numbers──▶ data/chunk-NNN/file-NNN.parquet      a row for each frame, a row group for each episode
        ──images───▶ videos/KEY/chunk-NNN/file-NNN.mp4    episodes one behind the other
        ──account──▶ meta/episodes/..., tasks.parquet, stats.json, info.json
```

The folder has its name when all is written; until then it grows beside it.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dsm.lerobot import layout
from dsm.lerobot.layout import DatasetError
from dsm.lerobot.stats import ImageStats, Stats, number_stats
from dsm.lerobot.video import VideoFile, describe_video

Image = NDArray[np.uint8]
"""An image, shape (height, width, 3), red, green and blue."""


@dataclass(frozen=True)
class Shape:
    """What the episodes of a dataset have in common."""

    robot: str
    fps: int
    state: tuple[str, ...]
    """Names of the values of `observation.state`."""
    action: tuple[str, ...]
    """Names of the values of `action`."""
    cameras: dict[str, tuple[int, int]]
    """Height and width of each camera's images."""


@dataclass
class Episode:
    """One episode, sampled at the rate of its dataset."""

    state: NDArray[np.float32]
    """Shape (frames, values)."""
    action: NDArray[np.float32]
    """Shape (frames, values): what was sent from each frame to the next."""
    tasks: list[str]
    """What was being done at each frame, in words."""
    images: Mapping[str, Iterable[Image]]
    """The images of each camera, one for each frame, in their order."""
    about: dict[str, Any] = field(default_factory=dict)
    """More columns of the episode, by name."""


class DatasetWriter:
    """A dataset that is being written. As a context it is finished when all went well, else removed."""

    def __init__(
        self,
        folder: Path,
        shape: Shape,
        *,
        data_file_mb: float = layout.DATA_FILE_MB,
        video_file_mb: float = layout.VIDEO_FILE_MB,
    ) -> None:
        """Raises `DatasetError` when the folder exists and is not empty."""
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise DatasetError(f"{folder}: is not empty; a dataset replaces nothing")
        self.folder = folder
        self.part = folder.with_name(f".part-{folder.name}")
        shutil.rmtree(self.part, ignore_errors=True)
        self.part.mkdir(parents=True)
        self.shape = shape
        self.data_file_mb, self.video_file_mb = data_file_mb, video_file_mb
        self.features = features_of(shape)
        self.tasks: dict[str, int] = {}
        self.episodes: list[dict[str, Any]] = []
        self.frames = 0
        self.numbers: dict[str, list[NDArray[Any]]] = {}
        self.pixels = {camera: ImageStats() for camera in shape.cameras}
        self.data: Any = None
        self.data_place, self.data_bytes = (0, 0), 0
        self.videos: dict[str, VideoFile] = {}
        self.video_places = dict.fromkeys(shape.cameras, (0, 0))

    def __enter__(self) -> DatasetWriter:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.finish()
        else:
            self.close_files()
            shutil.rmtree(self.part, ignore_errors=True)

    def put(self, episode: Episode) -> None:
        """Adds an episode; raises `DatasetError` when it does not fit the dataset."""
        length = len(episode.tasks)
        self.check(episode, length)
        number = len(self.episodes)
        columns = self.columns_of(episode, length, number)
        stats = {name: number_stats(values.reshape(length, -1)) for name, values in columns.items()}
        row: dict[str, Any] = {
            "episode_index": number,
            "tasks": list(dict.fromkeys(episode.tasks)),
            "length": length,
            "dataset_from_index": self.frames,
            "dataset_to_index": self.frames + length,
        }
        self.put_numbers(columns, row)
        for camera, images in episode.images.items():
            stats[image_key(camera)] = self.put_images(camera, images, length, row)
        for name, values in columns.items():
            self.numbers.setdefault(name, []).append(values.reshape(length, -1))
        row |= {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        row |= {f"stats/{feature}/{name}": value for feature, found in stats.items() for name, value in found.items()}
        row |= episode.about
        self.episodes.append(row)
        self.frames += length

    def check(self, episode: Episode, length: int) -> None:
        """Sizes and values of an episode."""
        shape, name = self.shape, f"episode {len(self.episodes)}"
        if length == 0:
            raise DatasetError(f"{name}: expected at least one frame")
        for what, values, names in (
            ("observation.state", episode.state, shape.state),
            ("action", episode.action, shape.action),
        ):
            if values.shape != (length, len(names)):
                raise DatasetError(f"{name}: {what}: expected shape {(length, len(names))}, got {values.shape}")
            if not np.isfinite(values).all():
                raise DatasetError(f"{name}: {what}: holds values that are not finite")
        if set(episode.images) != set(shape.cameras):
            raise DatasetError(f"{name}: expected images of {sorted(shape.cameras)}, got {sorted(episode.images)}")

    def columns_of(self, episode: Episode, length: int, number: int) -> dict[str, NDArray[Any]]:
        """The values of all features but images."""
        for task in episode.tasks:
            self.tasks.setdefault(task, len(self.tasks))
        frame = np.arange(length, dtype=np.int64)
        return {
            "observation.state": column_of(episode.state),
            "action": column_of(episode.action),
            "timestamp": (frame / self.shape.fps).astype(np.float32),
            "frame_index": frame,
            "episode_index": np.full(length, number, dtype=np.int64),
            "index": frame + self.frames,
            "task_index": np.array([self.tasks[task] for task in episode.tasks], dtype=np.int64),
        }

    def put_numbers(self, columns: dict[str, NDArray[Any]], row: dict[str, Any]) -> None:
        """Writes the rows of an episode, in a new file when they would make this one too large."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        arrays = {}
        for name, values in columns.items():
            flat = pa.array(values.ravel())
            arrays[name] = flat if values.ndim == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        table = pa.table(arrays)
        if self.data is not None and self.data_bytes + table.nbytes > self.data_file_mb * 2**20:
            self.data.close()
            self.data, self.data_bytes = None, 0
            self.data_place = layout.next_place(self.data_place, layout.FILES_IN_A_CHUNK)
        if self.data is None:
            self.data = pq.ParquetWriter(self.place(layout.DATA, self.data_place), table.schema)
        self.data.write_table(table, row_group_size=table.num_rows)
        self.data_bytes += table.nbytes
        row["data/chunk_index"], row["data/file_index"] = self.data_place

    def put_images(self, camera: str, images: Iterable[Image], length: int, row: dict[str, Any]) -> Stats:
        """Writes the images of an episode behind those of the one before."""
        key, size = image_key(camera), self.shape.cameras[camera]
        file = self.open_video(camera, length)
        begin, counted = file.frames, ImageStats()
        for image in images:
            if image.shape != (*size, 3) or image.dtype != np.uint8:
                raise DatasetError(
                    f"{key}: expected 8-bit images of {size[0]} x {size[1]}, got {image.dtype} {image.shape}"
                )
            file.put(image)
            counted.add(image)
        if counted.frames != length:
            raise DatasetError(f"{key}: expected {length} images, got {counted.frames}")
        self.pixels[camera].merge(counted)
        row[f"videos/{key}/chunk_index"], row[f"videos/{key}/file_index"] = self.video_places[camera]
        row[f"videos/{key}/from_timestamp"] = begin / self.shape.fps
        row[f"videos/{key}/to_timestamp"] = file.frames / self.shape.fps
        return counted.stats()

    def open_video(self, camera: str, length: int) -> VideoFile:
        """The file for the next episode: a new one when this one would become too large, going by its frames so far."""
        file = self.videos.get(camera)
        if file is not None and file.guess_bytes(length) > self.video_file_mb * 2**20:
            file.close()
            file = None
            self.video_places[camera] = layout.next_place(self.video_places[camera], layout.FILES_IN_A_CHUNK)
        if file is None:
            path = self.place(layout.VIDEO, self.video_places[camera], image_key(camera))
            file = self.videos[camera] = VideoFile(path, self.shape.fps, self.shape.cameras[camera])
        return file

    def place(self, template: str, place: tuple[int, int], key: str = "") -> Path:
        """The path of a file; its folder is there."""
        path = self.part / template.format(chunk_index=place[0], file_index=place[1], video_key=key)
        path.parent.mkdir(parents=True, exist_ok=True)
        return path

    def close_files(self) -> None:
        """Closes what is open."""
        if self.data is not None:
            self.data.close()
        for file in self.videos.values():
            file.close()

    def finish(self) -> None:
        """Writes what is known of the whole, and gives the folder its name."""
        self.close_files()
        if not self.episodes:
            shutil.rmtree(self.part)
            raise DatasetError(f"{self.folder}: expected at least one episode")
        self.write_episodes()
        self.write_tasks()
        for camera in self.shape.cameras:
            first = self.place(layout.VIDEO, (0, 0), image_key(camera))
            self.features[image_key(camera)]["info"] = describe_video(first)
        stats = {name: number_stats(np.concatenate(values)) for name, values in self.numbers.items()}
        stats |= {image_key(camera): counted.stats() for camera, counted in self.pixels.items()}
        self.write_json(layout.STATS, stats)
        self.write_json(layout.INFO, self.info())
        if self.folder.exists():
            self.folder.rmdir()
        self.part.rename(self.folder)

    def info(self) -> dict[str, Any]:
        """`info.json`."""
        return {
            "codebase_version": layout.VERSION,
            "robot_type": self.shape.robot,
            "total_episodes": len(self.episodes),
            "total_frames": self.frames,
            "total_tasks": len(self.tasks),
            "chunks_size": layout.FILES_IN_A_CHUNK,
            "data_files_size_in_mb": self.data_file_mb,
            "video_files_size_in_mb": self.video_file_mb,
            "fps": self.shape.fps,
            "splits": {"train": f"0:{len(self.episodes)}"},
            "data_path": layout.DATA,
            "video_path": layout.VIDEO if self.shape.cameras else None,
            "features": self.features,
        }

    def write_json(self, name: str, value: Any) -> None:
        """Writes a file below `meta`."""
        path = self.part / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(value, indent=4, ensure_ascii=False) + "\n")

    def write_episodes(self) -> None:
        """Writes the account of all episodes, with the columns of any of them."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        names = dict.fromkeys(name for row in self.episodes for name in row)
        table = pa.table({name: pa.array([row.get(name) for row in self.episodes]) for name in names})
        pq.write_table(table, self.place(layout.EPISODES, (0, 0)))

    def write_tasks(self) -> None:
        """Writes the texts so that pandas reads them as the index."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        column = {
            "metadata": None,
            "field_name": layout.TASK_COLUMN,
            "name": None,
            "numpy_type": "object",
            "pandas_type": "unicode",
        }
        number = {
            "metadata": None,
            "field_name": "task_index",
            "name": "task_index",
            "numpy_type": "int64",
            "pandas_type": "int64",
        }
        pandas = {
            "index_columns": [layout.TASK_COLUMN],
            "column_indexes": [],
            "columns": [number, column],
            "pandas_version": "2.0.0",
        }
        table = pa.table(
            {"task_index": pa.array(list(self.tasks.values()), pa.int64()), layout.TASK_COLUMN: list(self.tasks)}
        )
        path = self.part / layout.TASKS
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table.replace_schema_metadata({"pandas": json.dumps(pandas)}), path)


def column_of(values: NDArray[np.float32]) -> NDArray[np.float32]:
    """A feature of one value is a plain column."""
    values = values.astype(np.float32)
    return values[:, 0] if values.shape[1] == 1 else values


def image_key(camera: str) -> str:
    """The feature of a camera's images."""
    return f"observation.images.{camera}"


def features_of(shape: Shape) -> dict[str, dict[str, Any]]:
    """The features of a dataset, as `info.json` lists them."""
    features: dict[str, dict[str, Any]] = {
        "observation.state": {"dtype": "float32", "shape": [len(shape.state)], "names": list(shape.state)},
        "action": {"dtype": "float32", "shape": [len(shape.action)], "names": list(shape.action)},
    }
    for camera, (height, width) in shape.cameras.items():
        names = ["height", "width", "channels"]
        features[image_key(camera)] = {"dtype": "video", "shape": [height, width, 3], "names": names}
    return features | {name: dict(feature) for name, feature in layout.OWN_FEATURES.items()}
