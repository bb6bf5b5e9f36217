"""Cholesky's factor of a small positive definite matrix, and solutions by it, inside kernels."""

import math

from densarm.values.arrays import Array
from densarm.values.kernels import compiled_part


@compiled_part
def factorise(matrix: Array, factor: Array) -> None:
    """Write L, lower triangle of A = L Lᵀ (n, n), of which the upper triangle is read.

    Both may be one array, since neither triangle but the diagonal is read where it is written.

    Source: G. Golub and C. Van Loan, Matrix Computations, section 4.2.
    """
    for j in range(matrix.shape[0]):
        square = matrix[j, j]
        for k in range(j):
            square -= factor[j, k] * factor[j, k]
        factor[j, j] = math.sqrt(square)
        for i in range(j + 1, matrix.shape[0]):
            entry = matrix[j, i]
            for k in range(j):
                entry -= factor[i, k] * factor[j, k]
            factor[i, j] = entry / factor[j, j]


@compiled_part
def solve_factorised(factor: Array, x: Array) -> None:
    """Replace x (n,) by A⁻¹ x, given L as `factorise` writes it."""
    n = x.shape[0]
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]
