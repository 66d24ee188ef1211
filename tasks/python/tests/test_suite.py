"""Contract: a suite spread over Ray's workers comes to the bytes of the suite that one process runs, whatever is killed
on the way; its rows are in Parquet with the types of the program's schema; what cannot be run is code 2."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ray = pytest.importorskip("ray", reason="Ray is not installed: pip install 'dsm[ray]'")
pq = pytest.importorskip("pyarrow.parquet", reason="pyarrow is not installed: pip install 'dsm[ray]'")

from dsm.suite import read_flags  # noqa: E402
from dsm.suite_inputs import InputsTooLarge, has_inputs, list_inputs, pack_inputs, unpack_inputs  # noqa: E402

EPISODES = Path(__file__).resolve().parents[3] / "scenes/apartment/episodes"
NAMES = ("navigate_red_chair", "fetch_apple")
SUITE = [str(EPISODES / f"{name}.toml") for name in NAMES] + ["--seeds", "0..3", "--time-limit-s", "3"]
"""Three seconds are not enough for anything: the episodes fail, and are rows all the same."""
PATIENCE_S = 300.0
"""How long something that must happen is waited for."""


def environment() -> dict[str, str]:
    """Settings of the caller do not reach the tests."""
    return {name: value for name, value in os.environ.items() if not name.startswith("DSM_")}


def run(module: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs a module of the package to its end."""
    return subprocess.run(
        [sys.executable, "-m", module, *words], env=environment(), capture_output=True, text=True, check=False
    )


def spread(out: Path, *more: str) -> subprocess.Popen[str]:
    """Begins the suite on two workers; what it says on stderr goes into a file beside `out`."""
    words = [sys.executable, "-m", "dsm.suite", *SUITE, "--workers", "2", "--out", str(out), *more]
    with open(f"{out}.stderr", "w") as said:
        return subprocess.Popen(words, env=environment(), stdout=subprocess.DEVNULL, stderr=said, text=True)


def wait_for(what: Callable[[], Any]) -> Any:
    """Asks until there is an answer."""
    until = time.monotonic() + PATIENCE_S
    while time.monotonic() < until:
        if found := what():
            return found
        time.sleep(0.01)
    raise AssertionError(f"{what.__name__}: nothing for {PATIENCE_S} s")


def list_processes() -> Iterator[tuple[int, int, list[str]]]:
    """Number, parent and words of each process."""
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            words = (entry / "cmdline").read_text().split("\0")
            status = dict(line.split(":\t", 1) for line in (entry / "status").read_text().splitlines() if ":\t" in line)
        except (OSError, ValueError):
            continue
        yield int(entry.name), int(status["PPid"]), words


def list_episodes(driver: int) -> list[tuple[int, int]]:
    """Processes that run an episode for a driver, each with the worker that began it."""
    parents = {number: parent for number, parent, _ in list_processes()}

    def descends(number: int) -> bool:
        while number in parents and number != driver:
            number = parents[number]
        return number == driver

    return [(number, parent) for number, parent, words in list_processes() if "--seeds" in words and "suite" in words
            and words[words.index("--seeds") + 1] != "0..3" and descends(number)]  # fmt: skip


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The suite as one process runs it."""
    out = tmp_path_factory.mktemp("alone") / "out"
    ended = run("dsm", "suite", *SUITE, "--out", str(out), "--junit", f"{out}.xml")
    assert ended.returncode == 1, ended.stderr
    return out


def assert_same(out: Path, alone: Path) -> None:
    """The same rows, and of each episode the same summary and map."""
    assert (out / "suite.json").read_bytes() == (alone / "suite.json").read_bytes()
    assert (out / "index.html").read_bytes() == (alone / "index.html").read_bytes()
    for name in NAMES:
        for seed in range(3):
            for file in ("summary.json", "map.dsm", "failure.html", "done.json"):
                own = Path(f"{name}-{seed}", file)
                assert (out / own).read_bytes() == (alone / own).read_bytes(), own
    assert not list(out.glob(".part-*"))


def test_a_spread_suite_is_the_suite_of_one_process(alone: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = spread(out, "--junit", str(tmp_path / "out.xml"))
    assert driver.wait() == 1, Path(f"{out}.stderr").read_text()
    assert_same(out, alone)
    assert (tmp_path / "out.xml").read_bytes() == Path(f"{alone}.xml").read_bytes()

    rows = pq.read_table(out / "results.parquet").to_pylist()
    episodes = json.loads((out / "suite.json").read_text())["episodes"]
    assert [(row["id"], row["seed"]) for row in rows] == sorted((name, seed) for name in NAMES for seed in range(3))
    for row, episode in zip(rows, episodes, strict=True):
        assert {key: row[key] for key in ("id", "seed", "success", "failed_stage", "reason")} == {
            key: episode[key] for key in ("id", "seed", "success", "failed_stage", "reason")
        }
        assert {name: row[f"metrics.{name}"] for name in episode["metrics"]} == episode["metrics"]
    kinds = {field.name: str(field.type) for field in pq.read_schema(out / "results.parquet")}
    assert (kinds["seed"], kinds["success"], kinds["metrics.spl"]) == ("uint64", "bool", "double")
    # No episode was disturbed and none is a sequence: the columns have their types all the same.
    assert (kinds["disturbances"], kinds["parts.done"]) == ("list<element: string>", "int64")

    # Nothing is left to run, so no cluster is needed.
    again = run("dsm.suite", *SUITE, "--out", str(out), "--address", "127.0.0.1:1")
    assert again.returncode == 1, again.stderr
    assert_same(out, alone)


def test_a_worker_that_is_killed_loses_nothing(alone: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = spread(out)
    episode, worker = wait_for(lambda: list_episodes(driver.pid))[0]
    os.kill(worker, signal.SIGKILL)
    # The episode ends with its worker: nobody would hear of it.
    wait_for(lambda: not Path(f"/proc/{episode}").exists())
    assert driver.wait() == 1
    assert "its worker died" in Path(f"{out}.stderr").read_text()
    assert_same(out, alone)


def test_a_suite_that_is_killed_goes_on_where_it_was(alone: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = spread(out)
    done = wait_for(lambda: list(out.glob("[!.]*/done.json")))[0]
    os.kill(driver.pid, signal.SIGKILL)
    driver.wait()
    kept = done.stat().st_mtime_ns
    again = spread(out)
    assert again.wait() == 1
    assert_same(out, alone)
    assert done.stat().st_mtime_ns == kept, "what was done was run again"


def test_an_interrupted_suite_reports_what_is_done(alone: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    driver = spread(out)
    wait_for(lambda: list(out.glob("[!.]*/done.json")))
    driver.send_signal(signal.SIGINT)
    assert driver.wait() == 130, Path(f"{out}.stderr").read_text()
    rows = json.loads((out / "suite.json").read_text())["episodes"]
    assert rows == [row for row in json.loads((alone / "suite.json").read_text())["episodes"]
                    if (out / f"{row['id']}-{row['seed']}/done.json").exists()]  # fmt: skip
    assert 1 <= len(rows) < 6


def test_an_episode_whose_worker_always_dies_is_a_row(tmp_path: Path) -> None:
    program = tmp_path / "dsm"
    # Plans and gathers as ever; whoever runs an episode dies.
    program.write_text(
        f'#!/bin/sh\ncase "$*" in *--plan*|*--gather*|schema*) exec {sys.executable} -m dsm "$@";; esac\nkill -9 $$\n'
    )
    program.chmod(0o755)
    out = tmp_path / "out"
    ended = run("dsm.suite", SUITE[0], "--workers", "1", "--retries", "1", "--program", str(program), "--out", str(out))
    assert ended.returncode == 1, ended.stderr
    assert "run again, 1 of 1 times" in ended.stderr
    (row,) = json.loads((out / "suite.json").read_text())["episodes"]
    assert (row["failed_stage"], row["reason"]) == ("crash", "its process ended by SIGKILL")
    assert pq.read_table(out / "results.parquet").to_pylist()[0]["metrics.spl"] is None


def test_what_cannot_be_run_is_said(tmp_path: Path) -> None:
    out = str(tmp_path / "out")
    missing = run("dsm.suite", "nothing.toml", "--out", out)
    assert (missing.returncode, "nothing.toml: no such file or folder" in missing.stderr) == (2, True), missing.stderr
    unknown = run("dsm.suite", *SUITE, "--sedes", "1", "--out", out)
    assert (unknown.returncode, "--sedes" in unknown.stderr) == (2, True), unknown.stderr
    nobody = run("dsm.suite", *SUITE, "--out", out, "--address", "127.0.0.1:1")
    assert (nobody.returncode, "no Ray cluster at 127.0.0.1:1" in nobody.stderr) == (2, True), nobody.stderr


def test_flags_of_the_suite_are_handed_on() -> None:
    flags, rest = read_flags(["a", "--seeds", "0..2", "--workers", "3", "--junit", "x", "--address", "auto"])
    assert (flags.workers, flags.address, flags.retries) == (3, "auto", 3)
    assert rest == ["a", "--seeds", "0..2", "--junit", "x"]
    with pytest.raises(SystemExit):
        read_flags(["a", "--workers", "0"])


def test_a_machine_without_the_files_gets_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    shutil.copytree(EPISODES.parent, home)
    monkeypatch.chdir(tmp_path)
    inputs = list_inputs(Path("home/episodes/fetch_apple.toml"), Path("home/episodes/../scene.xml"))
    packed = pack_inputs(inputs)
    assert has_inputs(inputs)
    file = unpack_inputs(inputs, packed, tmp_path / "there")
    assert file.read_bytes() == (home / "episodes/fetch_apple.toml").read_bytes()
    assert (file.parent / "../scene.xml").read_bytes() == (home / "scene.xml").read_bytes()
    (home / "scene.xml").write_text("<mujoco/>")
    assert not has_inputs(inputs), "another scene"
    (home / "scene.xml").unlink()
    assert not has_inputs(inputs), "no scene"


def test_a_folder_that_is_more_than_a_scene_is_refused(tmp_path: Path) -> None:
    (tmp_path / "episode.toml").write_text("")
    with open(tmp_path / "film", "wb") as film:
        film.truncate(300 << 20)
    with pytest.raises(InputsTooLarge, match="at most 256 MiB, got 300 MiB"):
        list_inputs(tmp_path / "episode.toml", tmp_path / "scene.xml")
