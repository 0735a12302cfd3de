"""`python -m terrain_forge` is `terrain-forge`."""

from terrain_forge.cli import main

if __name__ == "__main__":
    main()
