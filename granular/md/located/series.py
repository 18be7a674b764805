"""The power series of a step: overlaps, rates and forces of a block of pairs as polynomials in τ.

    dξ/dt = η ,  η̇_c = G_c + w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1) ,  t = (hτ)^q

with inverse masses w and G the pull of gravity. With σ = q h^q, n+q times the coefficient n+q of ξ is σ η_n, of η
σ η̇_n. q = 1 is the plain clock; q > 1 makes the onset of a contact regular, where F starts like a fractional
power of t: a pair just touched has ξ = τ^q y with y_0 > 0, and ξ^α = τ^(qα) y^α is a power series again.
"""

from __future__ import annotations

from typing import Any

from granular._kernels import kernel
from granular.md.located.clock import elapsed
from granular.md.located.powers import clear, convolution, power_term, product_term, root_term
from granular.md.located.records import ACTIVE, DORMANT, ELASTIC, LINEAR, MIRROR, OPEN, ORDER, RESIDUAL


@kernel
def expand(pairs: Any, pool: Any, lo: int, hi: int, h: float, q: int) -> None:
    """Fill the rows x, e, f of pairs lo … hi-1 from their state, and g, the bracket φ, of those not open."""
    for c in range(lo, hi):
        prepare(pool[pairs[c].slot], q)
    scale = q * elapsed(h, q, 1.0)
    for n in range(ORDER - q + 1):
        step, below = scale / (n + q), 0.0
        for c in range(lo, hi):
            pair = pool[pairs[c].slot]
            pair.x[n + q] = step * pair.e[n]
            if pair.mode != OPEN:
                force_term(pair, n, q)
        pair = pool[pairs[lo].slot]
        for c in range(lo, hi):
            after = pool[pairs[c + 1].slot] if c + 1 < hi else pair
            force = pair.f[n]
            above = after.f[n] if c + 1 < hi else 0.0
            push = pair.lower * below - pair.inverse * force + pair.upper * above
            if n == 0:
                push += pair.pull
            pair.e[n + q] = step * push
            pair, below = after, force
    for c in range(lo, hi):
        complete(pool[pairs[c].slot], q)


@kernel
def prepare(pair: Any, q: int) -> None:
    """Write the lowest orders, and zeros where no term will be computed."""
    pair.x[0], pair.e[0] = pair.xi, pair.eta
    for n in range(1, q):
        pair.x[n], pair.e[n] = 0.0, 0.0
    first = 0 if pair.mode != ACTIVE else ORDER - q + 1
    for n in range(first, ORDER + 1):
        pair.f[n], pair.g[n] = 0.0, 0.0
    if pair.kind != LINEAR and pair.mode != OPEN:
        clear(pair.r, pair.rm)
        clear(pair.z, pair.zm)
        for n in range(MIRROR):
            pair.gm[n] = 0.0


@kernel
def force_term(pair: Any, n: int, q: int) -> None:
    """Add order n of the force (and of φ) of a pair that is not open; x is known to order n+q, e to order n."""
    if pair.kind == LINEAR:
        phi = bracket(pair, n)
        if pair.mode == RESIDUAL:
            pair.g[n] = phi
        else:
            pair.f[n] = phi
        return
    if pair.mode == DORMANT:
        return
    if pair.x[0] <= 0.0 and pair.e[0] < 0.0:  # opens now, together with another pair
        pair.f[n], pair.g[n] = 0.0, pair.gamma * pair.e[0] if n == 0 else 0.0
        return
    offset = q if pair.x[0] == 0.0 else 0
    if pair.kind == ELASTIC and pair.p != 1.5:
        power_term(pair.x, pair.r, pair.p, n, offset)
        pair.f[n] = pair.k * pair.r[n]
        return
    if pair.d == 0.25 and (pair.s == 1.0 or pair.s == 1.25):  # else z is needed for ξ^s
        root_term(pair.x, pair.z, pair.zm, n + offset // 4, offset)  # the next root starts half as late
        root_term(pair.z, pair.r, pair.rm, n, offset // 2)
    elif pair.d == 0.5:
        root_term(pair.x, pair.r, pair.rm, n, offset)
    else:
        power_term(pair.x, pair.r, pair.d, n, offset)
    phi = bracket(pair, n) if pair.s == 1.0 else bent_bracket(pair, n, offset)
    pair.g[n], pair.gm[ORDER - n] = phi, phi
    if pair.mode == ACTIVE:
        pair.f[n] = product_term(pair.r, pair.gm, n)


@kernel
def bracket(pair: Any, n: int) -> float:
    """Return order n of φ = kξ + γη, exactly 0 at the event that found it so."""
    if n == 0 and pair.exact:
        return 0.0
    phi: float = pair.k * pair.x[n] + pair.gamma * pair.e[n]
    return phi


@kernel
def bent_bracket(pair: Any, n: int, offset: int) -> float:
    """Return order n of φ = kξ^s + γη; for Tsuji's law ξ^(5/4) is ξ·ξ^(1/4)."""
    if pair.s == 1.25 and pair.d == 0.25:
        bent = convolution(pair.x, pair.r, n)
    else:
        power_term(pair.x, pair.z, pair.s, n, offset)
        bent = pair.z[n]
    if n == 0 and pair.exact:
        return 0.0
    phi: float = pair.k * bent + pair.gamma * pair.e[n]
    return phi


@kernel
def complete(pair: Any, q: int) -> None:
    """Take the event function φ = kξ + γη to full order; it needs no neighbours."""
    if pair.mode == OPEN or pair.s != 1.0 or (pair.mode == DORMANT and pair.kind != LINEAR):
        return
    for n in range(ORDER - q + 1, ORDER + 1):
        if pair.kind == LINEAR and pair.mode != RESIDUAL:
            pair.f[n] = bracket(pair, n)
        else:
            pair.g[n] = bracket(pair, n)
