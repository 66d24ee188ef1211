"""Contract: `python -m dsm` is the whole command line, with its exit codes, and errors say the same in both languages."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import dsm


def command_line(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "dsm", *words], capture_output=True, text=True, check=False)


def broken_episode(folder: Path) -> Path:
    file = folder / "broken.toml"
    file.write_text('version = 1\nscene = "scene.xml"\ntime_limit = 3\n\n[[step]]\ncommand = "Go"\n')
    return file


def test_help_version_and_usage_errors_end_as_the_program_does() -> None:
    assert command_line("--version").stdout.split() == ["dsm", dsm.__version__]
    assert "Run one episode" in command_line("--help").stdout
    wrong = command_line("run")
    assert wrong.returncode == 2 and "Usage: dsm run" in wrong.stderr


def test_an_exception_carries_the_text_of_the_command_line(tmp_path: Path) -> None:
    file = broken_episode(tmp_path)
    with pytest.raises(dsm.InputError) as raised:
        dsm.run_episode(file)
    text = str(raised.value)
    assert f"{file}:3" in text and "time_limit_s" in text, "file, line and what was meant"
    told = command_line("run", str(file), "--out", str(tmp_path / "out"))
    assert told.returncode == 2
    assert text in told.stderr
    assert not (tmp_path / "out").exists()


def test_a_map_is_listed_alike(tmp_path: Path, explored: dsm.Map) -> None:
    file = tmp_path / "map.dsm"
    explored.save(file)
    listed = json.loads(command_line("map", "show", str(file), "--json").stdout)
    assert listed["objects"] == explored.objects
    assert listed["relations"] == explored.relations
    assert listed["rooms"] == explored.rooms
    answer = json.loads(command_line("ground", str(file), "the fridge", "--json").stdout)
    assert answer == explored.ground("the fridge")
