"""Looks for inputs that break a command: `python -m tests.fuzz --minutes 60 [--kind recipes]`."""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from tests.fuzz.campaign import KINDS, Campaign


def main() -> int:
    """Run, and print the figures; 1 if anything was found."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=None, help="default: 1, or as inputs take")
    parser.add_argument("--inputs", type=int, default=None)
    parser.add_argument("--jobs", type=int, default=1, help="how many at a time")
    parser.add_argument("--corpus", action="store_true", help="first those that once failed")
    parser.add_argument("--kind", choices=KINDS, action="append", help="default: all")
    parser.add_argument("--seed", type=int, default=None, help="default: the clock's")
    parser.add_argument("--builds", type=float, default=0.1, help="part of good recipes built")
    parser.add_argument("--timed", action="store_true", help="kill at times, tell what is slow")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"), metavar="FOLDER")
    given = parser.parse_args()
    seed = int(time.time()) if given.seed is None else given.seed
    kinds = tuple(given.kind or KINDS)
    minutes = given.minutes or (1e9 if given.inputs else 1.0)
    campaign = Campaign(
        seed=seed, kinds=kinds, keep=given.keep, builds=given.builds, timed=given.timed
    )
    if given.corpus:
        campaign.regressions()
    figures = campaign.run(seconds=60 * minutes, inputs=given.inputs or 10**9, jobs=given.jobs)
    sys.stdout.write("\n".join([f"seed {seed}", *figures.lines()]) + "\n")
    return 1 if figures.findings else 0


if __name__ == "__main__":  # and not in a process that a command spawns
    sys.exit(main())
