"""The whole command line: ``python -m dsm run ...`` does what ``dsm run ...`` does."""

import signal
import sys

from dsm._dsm import main as run_command_line


def main() -> int:
    """Runs the command line with the words of this process and gives the exit code."""
    # Ctrl-C belongs to the command line, which stops the robot; Python would only note it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return run_command_line(["dsm", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
