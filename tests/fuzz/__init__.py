"""Hostile input: recipes, files, kills and faults; `python -m tests.fuzz --minutes 60`."""
