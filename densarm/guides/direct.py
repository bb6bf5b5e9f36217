"""DirectGuide: the goal alone."""

import numpy as np

from densarm.arrays import Array
from densarm.guides.guide import GuidePath


class DirectGuide:
    """Leave the whole way to the density, as [ZNV] does.

    The segment from start to goal is not claimed to be clear: the density bends around what
    blocks it, or gets stuck there. Where a reference is tracked it may come from either end, as
    `plan_motion` says.
    """

    def plan(self, start: Array, goal: Array, seed: int) -> GuidePath:  # noqa: ARG002
        """Return the goal as the only sub-goal.

        Args:
            start: (nq,) configuration.
            goal: (nq,) configuration.
            seed: not used, nothing here is random.
        """
        return GuidePath(np.stack([start, goal]), is_clear=False)
