"""Gradients of distances by the joint Jacobian and the nearest points."""

from densarm.arrays import Array
from densarm.compiled import compiled


@compiled
def write_pair_gradients(
    rows: Array, jacobian: Array, sign: Array, distance: Array, gradient: Array
) -> None:
    """Write distances and their gradients.

    Args:
        rows: [distance, normal, point 1, point 2], as `DistanceView` has it (K, 10).
        jacobian: world-frame joint Jacobian (6, nv).
        sign: S_2 - S_1 (K, nv).
        distance: overwritten (K,).
        gradient: overwritten (K, nv).
    """
    for k in range(rows.shape[0]):
        distance[k] = rows[k, 0]
        for j in range(sign.shape[1]):
            gradient[k, j] = 0.0
        add_pair_gradient(rows[k], jacobian, sign[k], 1.0, gradient[k])


@compiled
def add_pair_gradient(row: Array, jacobian: Array, sign: Array, factor: float, out: Array) -> None:
    """Add a multiple of the gradient of one distance in place.

    Args:
        row: [distance, normal, point 1, point 2], as `DistanceView` has it (10,).
        jacobian: world-frame joint Jacobian (6, nv).
        sign: S_2 - S_1 (nv,).
        factor: of the gradient.
        out: added to (nv,).
    """
    nx, ny, nz = row[1], row[2], row[3]
    px, py, pz = row[4], row[5], row[6]
    mx, my, mz = py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx
    for j in range(sign.shape[0]):
        if sign[j] != 0.0:
            out[j] += factor * (
                sign[j]
                * (
                    nx * jacobian[0, j]
                    + ny * jacobian[1, j]
                    + nz * jacobian[2, j]
                    + mx * jacobian[3, j]
                    + my * jacobian[4, j]
                    + mz * jacobian[5, j]
                )
            )
