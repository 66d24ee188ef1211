"""Contract: a recorded run becomes a LeRobotDataset v3.0 with the numbers and images of the recording, which the check
finds nothing in and LeRobot's own loader reads; whatever is broken in a dataset is found, with file and expectation."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pa = pytest.importorskip("pyarrow", reason="pyarrow is not installed: pip install 'dsm[lerobot]'")
av = pytest.importorskip("av", reason="PyAV is not installed: pip install 'dsm[lerobot]'")
import pyarrow.parquet as pq  # noqa: E402

from dsm import Recording  # noqa: E402
from dsm.lerobot import DatasetError, DatasetWriter, Episode, Shape, check_dataset, export_runs  # noqa: E402
from dsm.lerobot.recording import held_velocity  # noqa: E402

EPISODE = Path(__file__).resolve().parents[3] / "scenes/apartment/episodes/navigate_red_chair.toml"
SHAPE = Shape("porter", 5, ("x", "y", "z"), ("forward", "turn"), {"head": (48, 64)})
DATA = "data/chunk-000/file-000.parquet"
EPISODES = "meta/episodes/chunk-000/file-000.parquet"
VIDEO = "videos/observation.images.head/chunk-000/file-000.mp4"


def made_up(frames: int, number: int) -> Episode:
    """An episode whose images are grey, brighter from frame to frame and from episode to episode."""
    draw = np.random.default_rng(number)
    images = [np.full((48, 64, 3), (40 * number + 3 * frame) % 256, np.uint8) for frame in range(frames)]
    tasks = ["go to the chair"] * (frames // 2) + [f"take thing {number}"] * (frames - frames // 2)
    state = draw.normal(size=(frames, 3)).astype(np.float32)
    action = draw.normal(size=(frames, 2)).astype(np.float32)
    return Episode(state, action, tasks, {"head": images}, {"dsm/seed": number})


def write(folder: Path, lengths: tuple[int, ...] = (12, 7, 20), **limits: float) -> Path:
    """A dataset of made-up episodes."""
    with DatasetWriter(folder, SHAPE, **limits) as writer:
        for number, frames in enumerate(lengths):
            writer.put(made_up(frames, number))
    return folder


def read_images(path: Path) -> list[np.ndarray[Any, Any]]:
    """All images of a video."""
    with av.open(str(path)) as container:
        return [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]


def test_a_dataset_holds_what_was_put_in(tmp_path: Path) -> None:
    folder = write(tmp_path / "set")
    assert check_dataset(folder).findings == []
    info = json.loads((folder / "meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"], info["fps"]) == (3, 39, 4, 5)
    table = pq.read_table(folder / DATA)
    episodes = [made_up(frames, number) for number, frames in enumerate((12, 7, 20))]
    state = np.concatenate([episode.state for episode in episodes])
    assert np.array_equal(np.array(table["observation.state"].to_pylist(), dtype=np.float32), state)
    assert table["timestamp"].to_pylist()[12:14] == [0.0, pytest.approx(0.2)]
    stats = json.loads((folder / "meta/stats.json").read_text())
    assert stats["observation.state"]["mean"] == pytest.approx(state.mean(axis=0), abs=1e-6)
    assert stats["observation.state"]["q50"] == pytest.approx(np.median(state, axis=0), abs=1e-6)
    images = [image for episode in episodes for image in episode.images["head"]]
    pixels = np.stack(images).astype(np.float64) / 255
    assert np.ravel(stats["observation.images.head"]["mean"]) == pytest.approx(pixels.mean(axis=(0, 1, 2)))
    assert np.ravel(stats["observation.images.head"]["std"]) == pytest.approx(pixels.std(axis=(0, 1, 2)))
    # Video loses a little, but no image stands for another: neighbours differ by three levels.
    read = read_images(folder / VIDEO)
    assert len(read) == 39
    assert max(abs(float(got.mean()) - float(put.mean())) for got, put in zip(read, images, strict=True)) < 1.5


def test_the_same_episodes_give_the_same_bytes(tmp_path: Path) -> None:
    one, other = write(tmp_path / "one"), write(tmp_path / "other")
    files = sorted(path.relative_to(one) for path in one.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(other) for path in other.rglob("*") if path.is_file())
    for file in files:
        assert (one / file).read_bytes() == (other / file).read_bytes(), file


def test_files_that_are_full_are_followed_by_others(tmp_path: Path) -> None:
    folder = write(tmp_path / "set", (60, 60, 60), data_file_mb=0.004, video_file_mb=0.004)
    assert check_dataset(folder).findings == []
    assert len(list(folder.glob("data/chunk-000/*.parquet"))) > 1
    assert len(list((folder / VIDEO).parent.glob("*.mp4"))) > 1


def test_a_dataset_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    with (
        pytest.raises(DatasetError, match="expected 12 images, got 11"),
        DatasetWriter(tmp_path / "set", SHAPE) as writer,
    ):
        writer.put(made_up(7, 0))
        broken = made_up(12, 1)
        broken.images = {"head": list(broken.images["head"])[:11]}
        writer.put(broken)
    assert list(tmp_path.iterdir()) == []
    (tmp_path / "full").mkdir()
    (tmp_path / "full/file").write_text("")
    with pytest.raises(DatasetError, match="is not empty"):
        DatasetWriter(tmp_path / "full", SHAPE)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda e: setattr(e, "state", e.state[:, :2]), r"observation.state: expected shape \(7, 3\), got \(7, 2\)"),
        (lambda e: e.action.__setitem__((3, 1), np.nan), "action: holds values that are not finite"),
        (lambda e: setattr(e, "images", {}), r"expected images of \['head'\], got \[\]"),
        (
            lambda e: setattr(e, "images", {"head": [np.zeros((50, 64, 3), np.uint8)]}),
            "expected 8-bit images of 48 x 64",
        ),
        (lambda e: setattr(e, "tasks", []), "expected at least one frame"),
    ],
)
def test_an_episode_that_does_not_fit_is_refused(
    tmp_path: Path, change: Callable[[Episode], None], expected: str
) -> None:
    episode = made_up(7, 0)
    change(episode)
    with pytest.raises(DatasetError, match=expected), DatasetWriter(tmp_path / "set", SHAPE) as writer:
        writer.put(episode)


def change_json(name: str, change: Callable[[Any], None]) -> Callable[[Path], None]:
    """Changes a JSON file of a dataset."""

    def apply(folder: Path) -> None:
        value = json.loads((folder / name).read_text())
        change(value)
        (folder / name).write_text(json.dumps(value))

    return apply


def change_column(name: str, column: str, change: Callable[[list[Any]], list[Any]]) -> Callable[[Path], None]:
    """Changes a column of a Parquet file of a dataset."""

    def apply(folder: Path) -> None:
        table = pq.read_table(folder / name)
        field = table.schema.field(column)
        values = pa.array(change(table[column].to_pylist()), type=field.type)
        pq.write_table(table.set_column(table.column_names.index(column), field, values), folder / name)

    return apply


def overwrite(name: str, content: bytes) -> Callable[[Path], None]:
    """Puts a file into a dataset, or another one in its place."""

    def apply(folder: Path) -> None:
        (folder / name).write_bytes(content)

    return apply


def drop_column(name: str, column: str) -> Callable[[Path], None]:
    """Leaves out a column of a Parquet file of a dataset."""

    def apply(folder: Path) -> None:
        pq.write_table(pq.read_table(folder / name).drop_columns([column]), folder / name)

    return apply


def put(values: list[Any], place: int, value: Any) -> list[Any]:
    """The values with another one at a place."""
    return [*values[:place], value, *values[place + 1 :]]


def other_video(frames: int, fps: int, size: tuple[int, int]) -> Callable[[Path], None]:
    """Another video in the place of the dataset's."""

    def apply(folder: Path) -> None:
        from dsm.lerobot.video import VideoFile

        (folder / VIDEO).unlink()
        with VideoFile(folder / VIDEO, fps, size) as file:
            for _ in range(frames):
                file.put(np.zeros((*size, 3), np.uint8))

    return apply


INFO = "meta/info.json"
BROKEN: dict[str, tuple[Callable[[Path], None], str, str]] = {
    "no JSON": (overwrite(INFO, b"{"), INFO, "expected JSON"),
    "an older version": (change_json(INFO, lambda info: info.update(codebase_version="v2.1")), INFO, "expected v3.0, got 'v2.1'"),
    "no rate": (change_json(INFO, lambda info: info.update(fps=0)), INFO, "fps: expected a whole number above 0, got 0"),
    "too many episodes": (change_json(INFO, lambda info: info.update(total_episodes=4)), "meta/episodes", "expected 4 episodes"),
    "too few frames": (change_json(INFO, lambda info: info.update(total_frames=38)), "meta/episodes", "expected 38 frames"),
    "a template without file": (change_json(INFO, lambda info: info.update(data_path="data.parquet")), INFO, "data_path: expected a path with {chunk_index}, {file_index}"),
    "names for another shape": (change_json(INFO, lambda info: info["features"]["action"].update(names=["a"])), INFO, "names: expected 2"),
    "an unknown type": (change_json(INFO, lambda info: info["features"]["action"].update(dtype="float")), INFO, "dtype: expected one of"),
    "another shape": (change_json(INFO, lambda info: info["features"]["action"].update(shape=[3], names=None)), DATA, "action: expected 3 values in each row, got [2]"),
    "a feature without column": (change_json(INFO, lambda info: info["features"].update(more={"dtype": "float32", "shape": [2], "names": None})), DATA, "missing ['more']"),
    "no index feature": (change_json(INFO, lambda info: info["features"].pop("index")), INFO, "features: index: expected int64"),
    "splits beyond the end": (change_json(INFO, lambda info: info.update(splits={"train": "0:9"})), INFO, "splits: train"),
    "no tasks": (lambda folder: (folder / "meta/tasks.parquet").unlink(), "meta/tasks.parquet", "expected this file"),
    "tasks out of order": (change_column("meta/tasks.parquet", "task_index", lambda v: v[::-1]), "meta/tasks.parquet", "task_index: expected 0 to 3"),
    "a gap between episodes": (change_column(EPISODES, "dataset_from_index", lambda v: put(v, 1, 13)), EPISODES, "dataset_from_index: expected 12, got 13"),
    "a wrong length": (change_column(EPISODES, "length", lambda v: put(v, 2, 19)), EPISODES, "episode 2: length"),
    "an unknown task": (change_column(EPISODES, "tasks", lambda v: put(v, 0, ["fly"])), EPISODES, "['fly'] are not in meta/tasks.parquet"),
    "no place of data": (drop_column(EPISODES, "data/file_index"), EPISODES, "expected the columns ['data/file_index']"),
    "data that is no Parquet": (overwrite(DATA, b"x"), DATA, "expected a Parquet file"),
    "data that nobody names": (overwrite("data/chunk-000/file-007.parquet", b"x"), "data/chunk-000/file-007.parquet", "is named by no episode"),
    "a frame twice": (change_column(DATA, "frame_index", lambda v: put(v, 5, 4)), DATA, "frame_index: row 5: expected 5, got 4"),
    "a late stamp": (change_column(DATA, "timestamp", lambda v: put(v, 15, 0.7)), DATA, "episode 1: timestamp: row 3: expected 0.6000 s, got 0.7000 s"),
    "a task of another": (change_column(DATA, "task_index", lambda v: put(v, 0, 3)), DATA, "episode 0: task_index: expected the tasks"),
    "a value that is none": (change_column(DATA, "action", lambda v: put(v, 0, [float("nan"), 0.0])), DATA, "episode 0: action: holds values that are not finite"),
    "no statistics": (lambda folder: (folder / "meta/stats.json").unlink(), "meta/stats.json", "expected statistics"),
    "statistics of fewer": (change_json("meta/stats.json", lambda s: s["action"].update(count=[3])), "meta/stats.json", "count: expected 39 frames, got 3"),
    "a mean above all": (change_json("meta/stats.json", lambda s: s["action"].update(mean=[9.0, 9.0])), "meta/stats.json", "expected min <= mean <= max"),
    "no video": (lambda folder: (folder / VIDEO).unlink(), VIDEO, "expected this file"),
    "a video that is none": (overwrite(VIDEO, b"x"), VIDEO, "expected a video"),
    "a video of fewer frames": (other_video(38, 5, (48, 64)), VIDEO, "expected 39 frames for 3 episodes, got 38"),
    "a faster video": (other_video(39, 10, (48, 64)), VIDEO, "expected 5 frames a second, got 10"),
    "a larger video": (other_video(39, 5, (96, 64)), VIDEO, "expected images of 48 x 64 as meta/info.json says, got 96 x 64"),
    "a shifted video": (change_column(EPISODES, "videos/observation.images.head/from_timestamp", lambda v: put(v, 1, 2.6)), VIDEO, "episode 1: to_timestamp: expected 4.0000 s"),
}  # fmt: skip


@pytest.mark.parametrize("name", BROKEN)
def test_what_is_broken_is_found(tmp_path: Path, name: str) -> None:
    change, file, expected = BROKEN[name]
    folder = write(tmp_path / "set")
    change(folder)
    findings = check_dataset(folder).findings
    assert any(finding.startswith(f"{file}: ") and expected in finding for finding in findings), findings


def test_a_folder_without_info_is_no_dataset(tmp_path: Path) -> None:
    ended = subprocess.run(
        [sys.executable, "-m", "dsm.lerobot", "check", str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert (ended.returncode, "is no LeRobotDataset: expected meta/info.json" in ended.stderr) == (2, True), (
        ended.stderr
    )


def test_a_velocity_holds_until_the_driver_stops_by_itself() -> None:
    sent = np.array([np.nan, 0.3, np.nan, np.nan, 0.1])
    assert held_velocity(sent, np.array([0.0, 0.1, 0.2, 0.61, 0.7])).tolist() == [0.0, 0.3, 0.3, 0.0, 0.1]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of ten seconds and the run's folder beside it."""
    folder = tmp_path_factory.mktemp("recorded")
    words = [
        "run",
        str(EPISODE),
        "--seed",
        "1",
        "--time-limit-s",
        "10",
        "--record",
        str(folder / "run.mcap"),
        "--out",
        str(folder / "run"),
    ]
    settings = {name: value for name, value in os.environ.items() if not name.startswith("DSM_")}
    ended = subprocess.run(
        [sys.executable, "-m", "dsm", *words], env=settings, capture_output=True, text=True, check=False
    )
    assert ended.returncode == 1, ended.stderr
    return folder


@pytest.fixture(scope="module")
def exported(recorded: Path) -> Path:
    """The recording twice, as a dataset of two episodes."""
    run = recorded / "run.mcap"
    return export_runs([run, run], recorded / "set", summaries=[recorded / "run/summary.json"])


def test_a_dataset_has_the_numbers_and_images_of_the_recording(recorded: Path, exported: Path) -> None:
    assert check_dataset(exported).findings == []
    recording = Recording(recorded / "run.mcap")
    frames = list(recording.frames("head"))
    column = {name: recording.table[:, place] for place, name in enumerate(recording.columns)}
    table = pq.read_table(exported / DATA).slice(0, pq.read_table(exported / EPISODES)["length"][0].as_py())
    features = json.loads((exported / "meta/info.json").read_text())["features"]
    state = np.array(table["observation.state"].to_pylist())
    action = np.array(table["action"].to_pylist())
    assert len(table) > 40
    for row in (0, 17, len(table) - 1):
        at_s = frames[0].stamp_s + row / 5
        period = int(np.flatnonzero((column["now_s"] <= at_s + 1e-6) & np.isfinite(column["base.x_m"]))[-1])
        assert state[row, features["observation.state"]["names"].index("base.x_m")] == np.float32(
            column["base.x_m"][period]
        )
        within = (column["now_s"] >= at_s - 1e-6) & (column["now_s"] < at_s + 0.2 - 1e-6)
        turn = held_velocity(column["sent.base.turn_rad_per_s"], column["now_s"])[within].mean()
        assert action[row, features["action"]["names"].index("base.turn_rad_per_s")] == pytest.approx(turn, abs=1e-6)
    assert np.abs(action).max() > 0.1, "something was done"
    # The images are the recorded ones: each is nearer to its own frame than the frames of a second later are.
    images = read_images(exported / VIDEO)
    for row in (5, 20, 35):
        near = np.abs(images[row].astype(int) - frames[row].color.astype(int)).mean()
        far = np.abs(images[row].astype(int) - frames[row + 5].color.astype(int)).mean()
        assert near < 8.0 and near < far, (row, near, far)
    (task,) = set(pq.read_table(exported / EPISODES)["tasks"][0].as_py())
    assert task == recording.head["episode"]["step"][0]["command"]
    assert pq.read_table(exported / EPISODES)["dsm/judge_says"].to_pylist() == ["failure", "failure"]


def test_what_cannot_be_exported_is_said(recorded: Path, tmp_path: Path) -> None:
    def said(*words: str) -> str:
        ended = subprocess.run(
            [sys.executable, "-m", "dsm.lerobot", *words], capture_output=True, text=True, check=False
        )
        assert ended.returncode == 2, ended.stderr
        return ended.stderr

    out, run = str(tmp_path / "set"), str(recorded / "run.mcap")
    assert "no image of camera ['nose']; it has images of ['head'" in said(
        "export", run, "--out", out, "--camera", "nose"
    )
    (tmp_path / "text.mcap").write_text("nothing")
    assert "text.mcap" in said("export", str(tmp_path / "text.mcap"), "--out", out)
    assert "expected a summary.json" in said("export", run, "--out", out, "--summary", run)
    assert "--fps: expected 1 or more" in said("export", run, "--out", out, "--fps", "0")
    assert not (tmp_path / "set").exists()


def test_lerobot_reads_it(exported: Path) -> None:
    loader = pytest.importorskip(
        "lerobot.datasets.lerobot_dataset", reason="LeRobot is not installed: pip install lerobot"
    )
    dataset = loader.LeRobotDataset("dsm/test", root=exported, video_backend="pyav")
    table = pq.read_table(exported / DATA)
    assert (len(dataset), dataset.fps, dataset.num_episodes) == (len(table), 5, 2)
    images = read_images(exported / VIDEO)
    for row in (0, 21, len(table) - 1):
        item = dataset[row]
        assert item["observation.state"].tolist() == table["observation.state"][row].as_py()
        assert item["action"].tolist() == table["action"][row].as_py()
        assert item["task"] == "Go to the red chair"
        shown = item["observation.images.head"].permute(1, 2, 0).numpy() * 255
        assert np.abs(shown - images[row]).mean() < 2.0, row
