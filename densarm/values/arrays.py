"""The array types of the whole library."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""A numpy array of float64."""

Vector = Sequence[float] | NDArray[np.floating | np.integer]
"""A few numbers, such as x y z, in any form that reads as a vector."""
