"""Checks the videos of a LeRobotDataset v3.0 against its episodes."""

from __future__ import annotations

from typing import Any

from dsm.lerobot import layout
from dsm.lerobot.check import Dataset
from dsm.lerobot.check_tables import TIME_TOLERANCE_S


def check_videos(dataset: Dataset) -> None:
    """Each file: readable, of the right size and rate, with a frame where each frame of its episodes is looked for."""
    for key in dataset.video_keys:
        named: dict[str, list[dict[str, Any]]] = {}
        for row in dataset.episodes:
            place = {"chunk_index": row[f"videos/{key}/chunk_index"], "file_index": row[f"videos/{key}/file_index"]}
            named.setdefault(dataset.info["video_path"].format(video_key=key, **place), []).append(row)
        for path in sorted((dataset.folder / "videos" / key).glob("chunk-*/file-*.mp4")):
            if (name := str(path.relative_to(dataset.folder))) not in named:
                dataset.find(name, "is named by no episode")
        for name, rows in named.items():
            check_ranges(dataset, key, name, rows)
            check_video(dataset, key, name, rows)


def check_ranges(dataset: Dataset, key: str, name: str, rows: list[dict[str, Any]]) -> None:
    """The times of the episodes in one file: as long as the episodes, one behind the other."""
    end = 0.0
    for row in rows:
        begin, upto = row[f"videos/{key}/from_timestamp"], row[f"videos/{key}/to_timestamp"]
        where = f"episode {row['episode_index']}"
        if begin < end - TIME_TOLERANCE_S:
            dataset.find(name, f"{where}: from_timestamp: expected {end:.4f} s or later, got {begin:.4f} s")
        length_s = row["length"] / dataset.info["fps"]
        if abs(upto - begin - length_s) > TIME_TOLERANCE_S:
            dataset.find(
                name,
                f"{where}: to_timestamp: expected {begin + length_s:.4f} s for {row['length']} frames,"
                f" got {upto:.4f} s",
            )
        end = upto


def check_video(dataset: Dataset, key: str, name: str, rows: list[dict[str, Any]]) -> None:
    """One file."""
    import av

    path = dataset.folder / name
    if not path.is_file():
        dataset.find(name, "expected this file")
        return
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                dataset.find(name, "expected a video stream")
                return
            stream = container.streams.video[0]
            packets = [packet for packet in container.demux(stream) if packet.pts is not None]
            stamps = sorted(float(packet.pts * packet.time_base) for packet in packets)
            found = (stream.height, stream.width)
            rate, codec = float(stream.average_rate or 0), stream.codec.canonical_name
            first_decodes = decodes(container, stream)
    except av.error.FFmpegError as error:
        dataset.find(name, f"expected a video: {error}")
        return
    feature = dataset.info["features"][key]
    expected = size_of(feature)
    if found != expected:
        dataset.find(
            name, f"expected images of {expected[0]} x {expected[1]} as {layout.INFO} says, got {found[0]} x {found[1]}"
        )
    fps = dataset.info["fps"]
    if abs(rate - fps) > 1e-3:
        dataset.find(name, f"expected {fps} frames a second, got {rate:g}")
    told = feature.get("info") or {}
    if (said := told.get("video.codec", codec)) != codec:
        dataset.find(name, f"expected the codec {said} as {layout.INFO} says, got {codec}")
    if not first_decodes:
        dataset.find(name, "its first image cannot be decoded")
    check_frames(dataset, key, name, rows, stamps)


def decodes(container: Any, stream: Any) -> bool:
    """Whether the first image comes out."""
    container.seek(0, stream=stream)
    return next(container.decode(stream), None) is not None


def size_of(feature: dict[str, Any]) -> tuple[int, int]:
    """Height and width, whether channels stand last or first."""
    names, shape = feature.get("names") or [], feature["shape"]
    first = names[:1] in (["channels"], ["channel"], ["c"]) or shape[2] not in (1, 3)
    return (shape[1], shape[2]) if first else (shape[0], shape[1])


def check_frames(dataset: Dataset, key: str, name: str, rows: list[dict[str, Any]], stamps: list[float]) -> None:
    """A frame where each frame of each episode is looked for, and none besides."""
    fps = dataset.info["fps"]
    expected = sum(row["length"] for row in rows)
    if len(stamps) != expected:
        dataset.find(name, f"expected {expected} frames for {len(rows)} episodes, got {len(stamps)}")
        return
    wanted = [row[f"videos/{key}/from_timestamp"] + frame / fps for row in rows for frame in range(row["length"])]
    for number, (at, want) in enumerate(zip(stamps, wanted, strict=True)):
        if abs(at - want) > TIME_TOLERANCE_S:
            dataset.find(name, f"frame {number}: expected {want:.4f} s, got {at:.4f} s")
            return
