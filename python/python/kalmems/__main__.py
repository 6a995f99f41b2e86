"""The command `kalmems`, as `python -m kalmems` and as a program of its own."""

import sys

from ._kalmems import run_command


def main() -> None:
    """Does what the arguments of the program say."""
    sys.exit(run_command(["kalmems", *sys.argv[1:]], owns_process=True))


if __name__ == "__main__":
    main()
