"""The power series of a step when every law at work is linear: F = kξ + γη, one clock t = hτ, no powers.

    (n+1) ξ_(n+1) = h η_n ,  (n+1) η_(n+1) = h (w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1))_n  (+ h G at n = 0)
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.records import ACTIVE, DORMANT, ORDER, RESIDUAL


@kernel
def expand_linear(pairs: Any, pool: Any, lo: int, hi: int, h: float) -> None:
    """Fill the rows x, e, f (and g of residual pairs) of pairs lo … hi-1 from their state."""
    if hi == lo + 2:
        expand_two(pool[pairs[lo].slot], pool[pairs[lo + 1].slot], h)
    else:
        expand_run(pairs, pool, lo, hi, h)
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        if pair.mode == RESIDUAL:
            for n in range(ORDER + 1):
                pair.g[n] = pair.k * pair.x[n] + pair.gamma * pair.e[n]
            if pair.exact:
                pair.g[0] = 0.0


@kernel
def works(pair: Any) -> float:
    """Return 1 if the pair exerts a force, else 0."""
    return 1.0 if pair.mode == ACTIVE or pair.mode == DORMANT else 0.0


@kernel
def expand_run(pairs: Any, pool: Any, lo: int, hi: int, h: float) -> None:
    """Any number of pairs."""
    for c in range(lo, hi):
        pair = pool[pairs[c].slot]
        pair.x[0], pair.e[0] = pair.xi, pair.eta
    for n in range(ORDER + 1):
        for c in range(lo, hi):
            pair = pool[pairs[c].slot]
            pair.f[n] = 0.0
            if pair.mode == ACTIVE or pair.mode == DORMANT:
                pair.f[n] = pair.k * pair.x[n] + pair.gamma * pair.e[n]
                if n == 0 and pair.exact:
                    pair.f[0] = 0.0
        if n == ORDER:
            break
        below, step = 0.0, h / (n + 1)
        pair = pool[pairs[lo].slot]
        for c in range(lo, hi):
            after = pool[pairs[c + 1].slot] if c + 1 < hi else pair
            force = pair.f[n]
            above = after.f[n] if c + 1 < hi else 0.0
            push = pair.lower * below - pair.inverse * force + pair.upper * above
            if n == 0:
                push += pair.pull
            pair.x[n + 1] = step * pair.e[n]
            pair.e[n + 1] = step * push
            pair, below = after, force


@kernel
def expand_two(a: Any, b: Any, h: float) -> None:
    """Two pairs, the most frequent case: the same sums, kept in registers."""
    xa, ea, xb, eb = a.xi, a.eta, b.xi, b.eta
    ka, ga, kb, gb = works(a) * a.k, works(a) * a.gamma, works(b) * b.k, works(b) * b.gamma
    push_a, push_b, between, across = a.pull, b.pull, a.upper, b.lower
    own_a, own_b = a.inverse, b.inverse
    x1, e1, f1, x2, e2, f2 = a.x, a.e, a.f, b.x, b.e, b.f
    for n in range(ORDER + 1):
        fa, fb = ka * xa + ga * ea, kb * xb + gb * eb
        if n == 0:
            fa, fb = (0.0 if a.exact else fa), (0.0 if b.exact else fb)
        x1[n], e1[n], f1[n], x2[n], e2[n], f2[n] = xa, ea, fa, xb, eb, fb
        step = h / (n + 1)
        xa, xb = step * ea, step * eb
        ea, eb = step * (between * fb - own_a * fa + push_a), step * (across * fa - own_b * fb + push_b)
        push_a, push_b = 0.0, 0.0
