"""Exports of worlds, written and listed."""

from terrain_forge.model import exporter


def exported(kind, world, directory, **options):
    """Write a world in a format into a new folder, which is returned; its report lists it all."""
    directory.mkdir()
    module = exporter(kind)
    report = module.export(world, directory, options=module.Options(**options))
    found = sorted(p.relative_to(directory) for p in directory.rglob("*") if p.is_file())
    assert list(report.files) == found
    return directory
