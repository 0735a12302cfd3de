"""Formats of datasets, a module each; `terrain_forge.datasets.dataset_kinds()` finds them."""
