"""`python -m terrain_forge` is `terrain-forge`."""

from terrain_forge.cli import run

if __name__ == "__main__":
    run()
