"""Compiled linear algebra of small symmetric systems; numba compiles NumPy's for seconds, with its error messages."""

from __future__ import annotations

import math

from golem.kernels import njit
from golem.types import Array


@njit(cache=True, nogil=True)
def cholesky(A: Array, n: int) -> None:
    """Overwrite the lower triangle of the first `n` rows of `A`, positive definite, by L with A = L L^T."""
    for i in range(n):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= A[i, k] * A[j, k]
            A[i, j] = total / A[j, j] if j < i else math.sqrt(total)


@njit(cache=True, nogil=True)
def solve_cholesky(L: Array, n: int, b: Array) -> None:
    """Overwrite the first `n` numbers of `b` by x with L L^T x = b; `L` as `cholesky` leaves it."""
    for i in range(n):
        for k in range(i):
            b[i] -= L[i, k] * b[k]
        b[i] /= L[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            b[i] -= L[k, i] * b[k]
        b[i] /= L[i, i]
