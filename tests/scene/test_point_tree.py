"""The tree of a cloud: every point once, in boxes that hold it."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from densarm.scene.point_tree import point_tree


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(1, 300), distinct=st.integers(1, 300))
def test_boxes_hold_the_points_of_their_nodes(seed: int, count: int, distinct: int) -> None:
    random = np.random.default_rng(seed)
    points = random.normal(size=(distinct, 3))[random.integers(0, distinct, count)]
    tree = point_tree(points)
    np.testing.assert_array_equal(np.sort(tree.points, axis=0), np.sort(points, axis=0))
    depth = (len(tree.boxes) + 1).bit_length() - 2
    node = 0
    for level in range(depth + 1):
        for i in range(1 << level):
            own = tree.points[(i * count) >> level : ((i + 1) * count) >> level]
            np.testing.assert_array_equal(tree.boxes[node], [*own.min(axis=0), *own.max(axis=0)])
            assert level < depth or len(own) <= 8
            node += 1
    assert node == len(tree.boxes)
