"""One episode of a suite on a worker, as a process of its own, and its folder on the way back."""

from __future__ import annotations

import ctypes
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsm.suite_inputs import Inputs, has_inputs, unpack_inputs


@dataclass(frozen=True)
class Job:
    """What a worker needs for an episode."""

    episode: dict[str, Any]
    """As `dsm suite --plan` prints it."""
    program: str | None
    """As `name_program` takes it."""
    threads: int
    inputs: Inputs
    bundle: list[Any]
    """A reference to the files in one archive; only a machine without them fetches it."""


@dataclass(frozen=True)
class Ran:
    """An episode that was run, whatever became of its task."""

    node: str
    """Name of the machine."""
    line: dict[str, Any]
    """Its row."""
    folder: bytes
    """Its folder as an archive."""
    fingerprint: str | None
    """What decided it; `None` when it broke, and so would be run again."""


@dataclass(frozen=True)
class Lost:
    """An episode that was not carried to its end."""

    reason: str


class NodeError(Exception):
    """A machine cannot run the episodes of this suite."""


def name_program(file: str | None) -> list[str]:
    """The words that begin a command line: a file, or this package as this machine has it."""
    return [file] if file is not None else [sys.executable, "-m", "dsm"]


def run_episode(job: Job) -> Ran | Lost:
    """Runs an episode where Ray has put this call."""
    program = name_program(job.program)
    with tempfile.TemporaryDirectory(prefix="dsm-suite-") as scratch:
        if has_inputs(job.inputs):
            file, working_folder = job.inputs.file, job.inputs.working_folder
        else:
            import ray

            file = str(unpack_inputs(job.inputs, ray.get(job.bundle[0]), Path(scratch, "inputs")))
            working_folder = scratch
        out = Path(scratch, "out")
        ended = subprocess.run(
            [*program, *suite_of_one(job, file, out)],
            cwd=working_folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
            preexec_fn=dies_with(os.getpid()), check=False,
        )  # fmt: skip
        if ended.returncode < 0:
            return Lost(f"its process ended by {signal.Signals(-ended.returncode).name}")
        node = os.uname().nodename
        if ended.returncode not in (0, 1):
            said = ended.stderr.decode(errors="replace").strip()
            raise NodeError(f"{node}: {' '.join(program)} ended with {ended.returncode}: {said}")
        return read_episode(job, out, node)


def suite_of_one(job: Job, file: str, out: Path) -> list[str]:
    """The words after `dsm` that run just this episode. All that decides it is said, so no environment counts."""
    episode = job.episode
    words = ["suite", file, "--out", str(out), "--seeds", f"{episode['seed']}..{episode['seed'] + 1}"]
    words += ["--threads", str(job.threads), "--time-limit-s", repr(episode["time_limit_s"])]
    for name in ("robot", "physics", "perception", "backend"):
        words += [f"--{name}", episode[name]]
    return words


def dies_with(parent: int) -> Callable[[], None] | None:
    """Lets a process end with its worker; only Linux knows how. Elsewhere it runs on, and nobody hears of it."""
    if sys.platform != "linux":
        return None
    library = ctypes.CDLL(None)
    set_death_signal = 1

    def prepare() -> None:
        library.prctl(set_death_signal, signal.SIGKILL)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)

    return prepare


def read_episode(job: Job, out: Path, node: str) -> Ran:
    """Reads back what the suite of one has left."""
    (line,) = json.loads((out / "suite.json").read_text())["episodes"]
    own = out / f"{job.episode['id']}-{job.episode['seed']}"
    done = own / "done.json"
    fingerprint = json.loads(done.read_text())["fingerprint"] if done.is_file() else None
    return Ran(node, line, pack_folder(own), fingerprint)


def pack_folder(folder: Path) -> bytes:
    """The files of an episode's folder in one archive."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for path in sorted(folder.iterdir()):
            archive.write(path, path.name)
    return packed.getvalue()


def unpack_folder(packed: bytes, folder: Path) -> None:
    """Lays an episode's folder where it belongs, whole or not at all."""
    part = folder.with_name(f".part-{folder.name}")
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        archive.extractall(part)
    if folder.exists():
        shutil.rmtree(folder)
    part.rename(folder)
