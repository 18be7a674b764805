"""Reading a computed piece: values, integrals and the state at its end."""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.records import ORDER

INVERSE = (0.0, *(1.0 / n for n in range(1, ORDER + 5)))


@kernel
def value(row: Any, tau: float) -> float:
    """Return Σ row_j τ^j; even and odd powers apart, which are two short chains of operations instead of a long one."""
    square = tau * tau
    even, odd = row[ORDER], 0.0
    for j in range(ORDER - 1, 0, -2):
        odd = odd * square + row[j]
        even = even * square + row[j - 1]
    out: float = even + odd * tau
    return out


@kernel
def move(pair: Any, tau: float) -> None:
    """Set overlap and rate of a pair to those at τ."""
    x, e, square = pair.x, pair.e, tau * tau
    xi, eta, xi_odd, eta_odd = x[ORDER], e[ORDER], 0.0, 0.0
    for j in range(ORDER - 1, 0, -2):
        xi_odd = xi_odd * square + x[j]
        eta_odd = eta_odd * square + e[j]
        xi = xi * square + x[j - 1]
        eta = eta * square + e[j - 1]
    pair.xi, pair.eta = xi + xi_odd * tau, eta + eta_odd * tau


@kernel
def integral(row: Any, q: int, tau: float) -> float:
    """Return ∫ Σ row_j τ^j q τ^(q-1) dτ, to be multiplied by h^q."""
    square = tau * tau
    even, odd = row[ORDER] * INVERSE[ORDER + q], 0.0
    for j in range(ORDER - 1, 0, -2):
        odd = odd * square + row[j] * INVERSE[j + q]
        even = even * square + row[j - 1] * INVERSE[j - 1 + q]
    total = even + odd * tau
    for _ in range(q):
        total *= tau
    out: float = q * total
    return out


@kernel
def slope(row: Any, out: Any) -> None:
    """Write the coefficients of the derivative of `row`."""
    for j in range(ORDER):
        out[j] = (j + 1) * row[j + 1]
    out[ORDER] = 0.0


@kernel
def shift(row: Any, tau: float) -> None:
    """Let a row begin at τ: Horner's scheme, once for each coefficient."""
    for first in range(ORDER):
        for j in range(ORDER - 1, first - 1, -1):
            row[j] += row[j + 1] * tau
