"""Products, roots and powers of power series, one order at a time.

A series may start at a higher order: of ξ = τ^offset y with y_0 ≠ 0 the row holds y from index `offset` on, and ξ^α
starts at α·offset, which must be whole.

Products run over blocks of eight terms: one factor is kept backwards in a `mirror` with zeros behind it, terms not
known yet are zero, and the few loop lengths are soon foreseen by the processor, which a loop over n terms never is.
"""

from __future__ import annotations

import math
from typing import Any

from granular._kernels import kernel
from granular.md.located.records import MIRROR, ORDER, PADDED


@kernel
def clear(row: Any, mirror: Any) -> None:
    """Set a row and a mirror to zero before their first order is written."""
    for j in range(PADDED):
        row[j] = 0.0
    for j in range(MIRROR):
        mirror[j] = 0.0


@kernel
def product_term(a: Any, mirror: Any, n: int) -> float:
    """Return order n of the product of two series, Σ a_j b_(n-j), the second backwards: b_i = mirror[ORDER - i]."""
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for block in range(n // 8 + 1):
        j, i = (8 * block) & 31, (ORDER - n + 8 * block) & 63  # masks tell a compiler that no index is negative
        s0 += a[j] * mirror[i] + a[j + 4] * mirror[i + 4]
        s1 += a[j + 1] * mirror[i + 1] + a[j + 5] * mirror[i + 5]
        s2 += a[j + 2] * mirror[i + 2] + a[j + 6] * mirror[i + 6]
        s3 += a[j + 3] * mirror[i + 3] + a[j + 7] * mirror[i + 7]
    return (s0 + s2) + (s1 + s3)


@kernel
def convolution(a: Any, b: Any, n: int) -> float:
    """Return order n of the product of two series, Σ a_j b_(n-j)."""
    total = 0.0
    for j in range(n + 1):
        total += a[j] * b[n - j]
    return total


@kernel
def root_term(x: Any, out: Any, mirror: Any, n: int, offset: int) -> None:
    """Write order n of r = √ξ and of its mirror: from r² = ξ, 2 r_0 r_n = ξ_n - Σ r_j r_(n-j)."""
    first = offset // 2
    order = n - first
    if order < 0:
        return
    if order == 0:
        out[n] = math.sqrt(x[offset])
    else:
        out[n] = (x[offset + order] - product_term(out, mirror, n + first)) / (2.0 * out[first])
    mirror[ORDER - n] = out[n]


@kernel
def power_term(x: Any, out: Any, alpha: float, n: int, offset: int) -> None:
    """Write order n of f = ξ^α: f' y = α f y' gives n y_0 f_n = Σ (α j - (n-j)) y_j f_(n-j) (Knuth, TAOCP 2, 4.7)."""
    first = int(alpha * offset + 0.5)
    order = n - first
    if order <= 0:
        out[n] = power(x[offset], alpha) if order == 0 else 0.0
        return
    total, weight = 0.0, alpha + 1.0
    for j in range(1, order + 1):
        total += (weight * j - order) * x[offset + j] * out[n - j]
    out[n] = total / (order * x[offset])


@kernel
def power(x: float, alpha: float) -> float:
    """Return x^α for x ≥ 0, by square roots where they do."""
    if alpha == 1.0:
        return x
    if alpha == 0.5:
        return math.sqrt(x)
    if alpha == 1.5:
        return x * math.sqrt(x)
    if alpha == 0.25:
        return math.sqrt(math.sqrt(x))
    return math.pow(x, alpha)
