"""Short names for the types that almost every file uses."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in double precision, of any shape."""
Mask = NDArray[np.bool_]
"""Yes or no for each element, of any shape."""
Key = tuple[str | int, ...]
"""Where something stands in a recipe: names of mappings and indices of lists, outermost first."""
