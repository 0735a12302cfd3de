"""`python -m terrain_forge` is `terrain-forge`."""

import os
import signal
import sys


def run() -> None:
    """Run the command line; an interrupt before it listens ends the process without a traceback."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    os.environ.setdefault("PROJ_DEBUG", "0")  # or it prints faults that our own lines tell of
    from terrain_forge.cli import run as run_cli

    run_cli()


if __name__ == "__main__":
    if not sys.flags.safe_path:
        del sys.path[0]  # the current folder, by `-m`: a random.py in it is nothing of ours
    run()
