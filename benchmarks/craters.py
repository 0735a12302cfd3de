"""Speed of the crater layer: 10 000 craters on 4001² and 1025² nodes, in seconds."""

from __future__ import annotations

import time

from terrain_forge.dtm import FlatDtm
from terrain_forge.making import plan
from terrain_forge.recipe import Recipe, TerrainSpec
from terrain_forge.terrain import BodyProduction, CraterLayer, Fractal, make_craters, shape_ground

ROUNDS = 3


def main() -> None:
    """Time both sizes, craters alone and with fractal detail."""
    for cells, smallest in ((4000, 2.8), (1024, 1.0)):
        craters = CraterLayer(
            production=BodyProduction(kind="neukum", age_ga=3.5), diameter_m=(smallest, 200.0)
        )
        detail = Fractal(longest_wavelength_m=64.0)
        for layers in ((craters,), (detail, craters)):
            terrain = TerrainSpec(spacing_m=0.25, layers=layers)
            side = 0.25 * cells
            dtm = FlatDtm(size_m=(side, side))
            site = plan(Recipe(name="b", body="moon", dtm=dtm, terrain=terrain, exports=()))
            number = len(make_craters(craters, site=site, area=site.bounds))
            shape_ground(site=site, window=site.window, layers=layers)  # compiles
            times = []
            for _ in range(ROUNDS):
                start = time.perf_counter()
                shape_ground(site=site, window=site.window, layers=layers)
                times.append(time.perf_counter() - start)
            kinds = " + ".join(layer.kind for layer in layers)
            print(f"{cells + 1}² nodes, {number} craters, {kinds}: {min(times):.2f} s")


if __name__ == "__main__":
    main()
