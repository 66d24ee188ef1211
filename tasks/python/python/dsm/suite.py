"""Suites spread over a Ray cluster: ``python -m dsm.suite PATH... --seeds A..B --out DIR``.

The flags and what lies in the output folder are those of ``dsm suite``, and so are its rows, value for value: each
worker runs one episode as a suite of its own, its folder is laid into ``--out``, and the report is written from there
by the program that writes it anyway. ``results.parquet`` holds the rows once more. What is done is not run again, so a
suite that was killed goes on where it was.

Needs the extra ``dsm[ray]``. See ``docs/batch.md``.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dsm.suite_episode import Job, Lost, Ran, name_program, run_episode, unpack_folder
from dsm.suite_inputs import InputsTooLarge, list_inputs, pack_inputs
from dsm.suite_rows import write_rows

OBJECT_STORE_BYTES = 512 << 20
"""What embedded workers may hold of results that were not fetched yet; one is a few megabytes."""

STARTS = 3
"""How often workers of this machine are tried to be started."""

ANSWER_S = 10.0
"""How long a cluster may take to answer."""


class SuiteError(Exception):
    """A suite cannot be carried out."""


@dataclass(frozen=True)
class Flags:
    """The flags that are not handed on to ``dsm suite``."""

    address: str | None
    workers: int | None
    retries: int
    threads: int
    program: str | None
    """A file that each machine has; `None` for this package, wherever a machine has it."""


def read_flags(words: Sequence[str]) -> tuple[Flags, list[str]]:
    """Parses what is known here; the rest is for ``dsm suite``."""
    parser = argparse.ArgumentParser(
        prog="python -m dsm.suite",
        description="Runs all episodes found below the given paths on a Ray cluster.",
        epilog="All other arguments are those of `dsm suite`: see `python -m dsm suite --help`.",
        allow_abbrev=False,
    )
    parser.add_argument("--address", help="a Ray cluster, HOST:PORT or `auto`; without it workers of this machine")
    parser.add_argument("--workers", type=positive, help="episodes that run side by side; default: one per free core")
    parser.add_argument("--threads", type=positive, default=1, help="threads and cores of each episode; default: 1")
    parser.add_argument(
        "--retries",
        type=not_negative,
        default=3,
        help="how often an episode whose worker died is run again; default: 3",
    )
    parser.add_argument(
        "--program", metavar="FILE", help="a `dsm` that each machine has at this path; default: this package"
    )
    known, rest = parser.parse_known_args(words)
    program = str(Path(known.program).resolve()) if known.program else None
    return Flags(known.address, known.workers, known.retries, known.threads, program), rest


def positive(text: str) -> int:
    """A whole number from 1."""
    if (number := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"expected 1 or more, got {number}")
    return number


def not_negative(text: str) -> int:
    """A whole number from 0."""
    if (number := int(text)) < 0:
        raise argparse.ArgumentTypeError(f"expected 0 or more, got {number}")
    return number


def main(words: Sequence[str] | None = None) -> int:
    """Plans, spreads, gathers; gives the exit code of ``dsm suite``."""
    flags, rest = read_flags(sys.argv[1:] if words is None else words)
    program = name_program(flags.program)
    planned = subprocess.run([*program, "suite", *rest, "--plan"], stdout=subprocess.PIPE, check=False)
    if planned.returncode != 0:
        return planned.returncode
    plan = json.loads(planned.stdout)
    folder = Path(plan["folder"])
    lines: list[dict[str, Any]] = []
    interrupted = False
    try:
        check_packages()
        spread(plan["episodes"], folder, flags, lines)
    except KeyboardInterrupt:
        interrupted = True
    except (SuiteError, InputsTooLarge) as error:
        print(f"dsm.suite: {error}", file=sys.stderr)
        return 2
    code = gather(flags, rest, lines)
    if code in (0, 1):
        write_rows(folder, program)
    return 130 if interrupted else code


def check_packages() -> None:
    """What is not installed is told of before hours of work, not after."""
    for name in ("pyarrow", "ray"):
        if importlib.util.find_spec(name) is None:
            raise SuiteError(f"{name} is not installed: pip install 'dsm[ray]'; `dsm suite` needs none of it")


def gather(flags: Flags, rest: Sequence[str], lines: list[dict[str, Any]]) -> int:
    """Has the report written from the folders, and from `lines` for episodes that did not come to their end."""
    with tempfile.NamedTemporaryFile("w", suffix=".json") as file:
        json.dump(lines, file)
        file.flush()
        command = [*name_program(flags.program), "suite", *rest, "--gather", file.name]
        return subprocess.run(command, check=False).returncode


def spread(episodes: list[dict[str, Any]], folder: Path, flags: Flags, lines: list[dict[str, Any]]) -> None:
    """Runs what is not done yet. Adds to `lines` the rows of the episodes that leave nothing to take over."""
    for left in folder.glob(".part-*"):
        shutil.rmtree(left)
    todo = [episode for episode in episodes if not episode["is_done"]]
    if not todo:
        return
    # Ray tells of workers that died on stdout, which is for the result alone.
    with redirect_stdout(sys.stderr), cluster(flags) as ray:
        Spread(ray, flags, folder, lines).run(todo)


@contextmanager
def cluster(flags: Flags) -> Iterator[Any]:
    """Connects to the cluster, or starts workers on this machine; ends both again."""
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    os.environ.setdefault("RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO", "0")
    import ray

    for left in reversed(range(STARTS)):
        try:
            start(ray, flags)
            break
        except OSError as error:
            raise SuiteError(f"no Ray cluster at {flags.address}: {error}") from error
        # Ray raises plain exceptions, too: on a busy machine it gives its own processes 30 s to begin.
        except Exception as error:
            ray.shutdown()
            if flags.address is not None or left == 0:
                raise SuiteError(f"Ray does not start: {error}") from error
    try:
        yield ray
    finally:
        ray.shutdown()


def start(ray: Any, flags: Flags) -> None:
    """Connects to the cluster, or starts workers on this machine."""
    common: dict[str, Any] = {"log_to_driver": False, "logging_level": "ERROR"}
    if flags.address is not None:
        reach(flags.address)
        ray.init(address=flags.address, **common)
        return
    cores = flags.threads * (flags.workers or max(1, (os.cpu_count() or 1) // flags.threads))
    store = {"object_store_memory": OBJECT_STORE_BYTES, "include_dashboard": False}
    ray.init(address="local", num_cpus=cores, **store, **common)


def reach(address: str) -> None:
    """Tries whether somebody listens; Ray itself would try for minutes. Raises `OSError`."""
    host, colon, port = address.removeprefix("ray://").rpartition(":")
    if colon and port.isdecimal():
        socket.create_connection((host, int(port)), timeout=ANSWER_S).close()


class Spread:
    """Episodes on their way through a cluster."""

    def __init__(self, ray: Any, flags: Flags, folder: Path, lines: list[dict[str, Any]]) -> None:
        self.ray = ray
        self.flags = flags
        self.folder = folder
        self.lines = lines
        # A worker that dies is told of here, so Ray itself need not try again.
        self.task = ray.remote(num_cpus=flags.threads, max_retries=0)(run_episode)
        self.bundles: dict[str, Any] = {}
        self.running: dict[Any, tuple[dict[str, Any], int]] = {}

    def run(self, todo: list[dict[str, Any]]) -> None:
        """Runs all; an episode is begun when a place is free."""
        waiting = todo[::-1]
        cores = int(self.ray.cluster_resources().get("CPU", 1))
        places = self.flags.workers or max(1, cores // self.flags.threads)
        done = 0
        try:
            while waiting or self.running:
                while waiting and len(self.running) < places:
                    self.begin(waiting.pop(), 0)
                ready, _ = self.ray.wait(list(self.running), num_returns=1)
                done += self.finish(ready[0])
                tell(f"{done} of {len(todo)} episodes")
        finally:
            for reference in self.running:
                self.ray.cancel(reference, force=True)

    def begin(self, episode: dict[str, Any], deaths: int) -> None:
        """Hands an episode to the cluster; the files of its scene go there once."""
        inputs = list_inputs(Path(episode["file"]), Path(episode["scene"]))
        if inputs.digest not in self.bundles:
            self.bundles[inputs.digest] = self.ray.put(pack_inputs(inputs))
        job = Job(episode, self.flags.program, self.flags.threads, inputs, [self.bundles[inputs.digest]])
        self.running[self.task.remote(job)] = (episode, deaths)

    def finish(self, reference: Any) -> int:
        """Takes in what has become of an episode; 0 when it is begun again."""
        from ray.exceptions import RayError, RayTaskError

        episode, deaths = self.running.pop(reference)
        name = f"{episode['id']} seed {episode['seed']}"
        try:
            result = self.ray.get(reference)
        except RayTaskError as error:
            raise SuiteError(f"{name}: {error.cause}") from error
        except RayError as error:
            result = Lost(f"its worker died ({type(error).__name__})")
        if isinstance(result, Ran):
            self.take(episode, name, result)
            return 1
        if deaths < self.flags.retries:
            tell(f"{name}: {result.reason}; run again, {deaths + 1} of {self.flags.retries} times")
            self.begin(episode, deaths + 1)
            return 0
        tell(f"{name}: {result.reason}; given up after {deaths + 1} times")
        crash = {"success": False, "failed_stage": "crash", "reason": result.reason, "metrics": None}
        self.lines.append({"id": episode["id"], "seed": episode["seed"], **crash})
        return 1

    def take(self, episode: dict[str, Any], name: str, ran: Ran) -> None:
        """Lays the folder of an episode into that of the suite."""
        if ran.fingerprint not in (None, episode["fingerprint"]):
            raise SuiteError(f"{name}: {ran.node} has another program or other files of the scene than this machine")
        unpack_folder(ran.folder, self.folder / f"{episode['id']}-{episode['seed']}")
        if ran.fingerprint is None:
            self.lines.append(ran.line)


def tell(what: str) -> None:
    """Progress goes to stderr."""
    print(f"dsm.suite: {what}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    sys.exit(main())
