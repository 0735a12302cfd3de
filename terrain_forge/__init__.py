"""terrain-forge: planetary worlds for people who build and test rovers.

    import terrain_forge as tf

    file = tf.load_recipe("recipes/hello.yaml")
    result = tf.build(file.recipe, "out", folder=file.folder)      # what the command line does
    site = tf.plan(file.recipe, folder=file.folder)                # or stage by stage
    world = tf.realise(site)
    world.ground.height_at(1.0, 2.0)

Names are imported when they are first used, so that `import terrain_forge` is fast; they are
listed in `__init__.pyi`.
"""

import sys

from lazy_loader import attach_stub

if sys.platform == "win32":  # no flock, no process groups
    raise ImportError("terrain-forge runs on Linux; on Windows install it in WSL 2")

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)

__version__ = "0.1.0"
