"""``python -m dsm.lerobot export`` and ``python -m dsm.lerobot check``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from dsm import Error
from dsm.lerobot import DatasetError, check_dataset, export_runs


def read_arguments(words: Sequence[str]) -> argparse.Namespace:
    """Parses the command line."""
    parser = argparse.ArgumentParser(
        prog="python -m dsm.lerobot", description="Datasets in the format LeRobotDataset v3.0."
    )
    commands = parser.add_subparsers(dest="command", required=True)
    export = commands.add_parser("export", help="write recordings as a dataset")
    export.add_argument("recordings", nargs="+", metavar="RUN.mcap", help="what `dsm run --record` has written")
    export.add_argument("--out", required=True, metavar="DIR", help="folder of the dataset; it must be new or empty")
    export.add_argument("--camera", action="append", metavar="NAME", help="a camera; may be given again; default: head")
    export.add_argument("--fps", type=int, help="frames a second; default: as the first camera")
    export.add_argument(
        "--summary", action="append", default=[], metavar="FILE", help="summary.json of a run; may be given again"
    )
    check = commands.add_parser("check", help="say what is wrong with a dataset; code 1 when something is")
    check.add_argument("dataset", type=Path, metavar="DIR")
    arguments = parser.parse_args(words)
    if arguments.command == "export" and arguments.fps is not None and arguments.fps < 1:
        parser.error(f"--fps: expected 1 or more, got {arguments.fps}")
    return arguments


def main(words: Sequence[str] | None = None) -> int:
    """Gives the exit code: 0, 1 when a check has findings, 2 for bad input."""
    arguments = read_arguments(sys.argv[1:] if words is None else words)
    try:
        if arguments.command == "check":
            return check(arguments.dataset)
        cameras = arguments.camera or ["head"]
        out = export_runs(
            arguments.recordings, arguments.out, cameras=cameras, fps=arguments.fps, summaries=arguments.summary
        )
        print(f"{len(arguments.recordings)} episodes in {out}")
        return 0
    except (DatasetError, Error) as error:
        print(f"dsm.lerobot: {error}", file=sys.stderr)
    except ImportError as error:
        print(f"dsm.lerobot: {error}: pip install 'dsm[lerobot]'", file=sys.stderr)
    return 2


def check(folder: Path) -> int:
    """Prints the findings, or what the dataset holds."""
    dataset = check_dataset(folder)
    for finding in dataset.findings:
        print(finding)
    if not dataset.findings:
        info = dataset.info
        print(
            f"{folder}: LeRobotDataset {info['codebase_version']}, {info['total_episodes']} episodes,"
            f" {info['total_frames']} frames"
        )
    return 1 if dataset.findings else 0


if __name__ == "__main__":
    sys.exit(main())
