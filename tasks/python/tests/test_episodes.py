"""Contract: an episode run from Python is that of the command line, byte for byte; other threads go on meanwhile; Ctrl-C
ends a run in order; bad input is refused before anything is written."""

import json
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import dsm

EPISODE = dsm.find_episode("navigate_kitchen")


def test_python_and_the_command_line_do_the_same(tmp_path: Path, small_episode: Path) -> None:
    ticks = 0
    over = threading.Event()

    def count() -> None:
        nonlocal ticks
        while not over.wait(0.001):
            ticks += 1

    counter = threading.Thread(target=count)
    counter.start()
    summary = dsm.run_episode(small_episode, seed=5, out=tmp_path / "python", perception="oracle")
    over.set()
    counter.join()
    assert ticks > 100, "the interpreter lock was held"
    words = ["run", str(small_episode), "--seed", "5", "--perception", "oracle", "--out", str(tmp_path / "line")]
    ended = subprocess.run([sys.executable, "-m", "dsm", *words], capture_output=True, check=False)
    assert ended.returncode == (0 if summary["success"] else 1)
    for name in ("summary.json", "map.dsm"):
        assert (tmp_path / "python" / name).read_bytes() == (tmp_path / "line" / name).read_bytes(), name
    assert summary == json.loads((tmp_path / "python" / "summary.json").read_text())
    assert summary["seed"] == 5 and summary["steps"][0]["outcome"] == "done"
    with pytest.raises(dsm.InputError, match="not empty"):
        dsm.run_episode(small_episode, out=tmp_path / "python")


def test_flags_are_checked_as_on_the_command_line(tmp_path: Path) -> None:
    with pytest.raises(dsm.InputError, match="noisy, oracle, pixels"):
        dsm.run_episode(EPISODE, perception="blurred")
    with pytest.raises(dsm.InputError, match="expected 1 to 36000 seconds"):
        dsm.run_episode(EPISODE, time_limit_s=0.0)
    with pytest.raises(dsm.InputError, match="porter"):
        dsm.run_episode(EPISODE, robot="butler")
    with pytest.raises(dsm.InputError, match="no/such.toml"):
        dsm.run_episode("no/such.toml", out=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_worker_threads_are_set_once() -> None:
    program = (
        "import dsm\n"
        "for threads in (2, 2, 1):\n"
        f"    dsm.run_episode({str(EPISODE)!r}, threads=threads, time_limit_s=1.0)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert "dsm.InputError: threads is 1, but this process works with 2" in ended.stderr, ended.stderr


def test_ctrl_c_ends_a_session_in_order() -> None:
    # Who starts programs in the background may have them ignore it.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    session = dsm.Session(EPISODE, seed=5)
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            session.step(duration_s=60.0)
    summary = session.finish()
    assert not summary["success"] and session.finish() == summary
    assert len(session.map.objects) >= 0
    with pytest.raises(dsm.RunError, match="finished"):
        session.explore()


def test_a_session_runs_skills_one_by_one(small_episode: Path) -> None:
    with dsm.Session(small_episode, seed=5, perception="oracle") as session:
        assert session.commands == ["Navigate to the table"] and session.seed == 5
        before = session.judge()
        assert [e["passed"] for e in before] == [False]
        refused = session.navigate("the unicorn")
        assert refused["outcome"] in ("absent", "failed"), refused
        skipped = session.run(session.commands[0])
        if refused["outcome"] == "failed":
            assert skipped["outcome"] == "skipped"
            session.forgive()
            session.run(session.commands[0])
        assert [e["passed"] for e in session.judge()] == [True]
        assert session.state()["time_s"] == session.time_s > 1.0
