"""Power series of a piece: overlaps, rates and forces of an island in τ.

    dξ/dt = η ,  dη_c/dt = G_c + w_c F_(c-1) - (w_c + w_(c+1)) F_c + w_(c+1) F_(c+1) ,  t = (hτ)^q

Here w are inverse masses in 1/kg, and G is the acceleration in m/s² by gravity and other external forces. For a driven
wall, G is itself a series, and pendula add -Ω² ξ. With σ = q h^q, coefficient n+q of ξ is σ η_n/(n+q). Coefficient n+q
of η is σ η̇_n/(n+q).

For q = 1 the time t is proportional to τ. q > 1 makes the onset of a contact regular if F starts like a fractional
power of t. A pair that just touches has ξ = τ^q y with y_0 > 0, and ξ^α = τ^(qα) y^α is again a power series. The
coefficients of such a ξ are the coefficients of y, shifted by `offset` = q.

Products are summed in groups of eight terms. One factor is stored backwards in a `mirror` followed by zeros, and
unknown terms are zero. Processors predict these few loop lengths well, unlike a loop over n terms.
"""

from __future__ import annotations

import math
from typing import Any

from granular._engine.kernels import DRIVEN, HUNG, RING, kernel
from granular.md.located.numbering import is_closed
from granular.md.located.pieces import elapsed_time, power
from granular.md.located.records import (
    ACTIVE,
    DORMANT,
    ELASTIC,
    LINEAR,
    MIRROR_LENGTH,
    OPEN,
    PADDED_LENGTH,
    RESIDUAL,
    SERIES_ORDER,
)
from granular.md.located.walls import drive


@kernel
def expand_series(pairs: Any, pool: Any, lo: int, hi: int, h: float, q: int, field: Any) -> None:
    """Compute the series of overlap, rate and force of the pairs lo … hi-1.

    They are `x`, `e` and `f` of each pair record, where t = (hτ)^q. Pairs that are not open also get `g`, the
    bracket φ of the force F = ξ^d φ. The series start from the overlap and rate of the pairs now. `field` is the record
    of driven walls or pendula, or None.
    """
    for c in range(lo, hi):
        prepare_series(pool[pairs[c].slot], q)
    if DRIVEN:
        drive(field, pairs, lo, hi, h, q)
    scale, last = q * elapsed_time(h, q, 1.0), hi + 1 if is_closed(pairs, lo, hi) else hi
    for n in range(SERIES_ORDER - q + 1):
        step, below = scale / (n + q), 0.0
        for c in range(lo, hi):
            pair = pool[pairs[c].slot]
            pair.x[n + q] = step * pair.e[n]
            if pair.mode == OPEN:
                continue
            if pair.kind == LINEAR:  # no call: it would dominate two linear pairs
                phi = 0.0 if n == 0 and pair.exact else pair.k * pair.x[n] + pair.gamma * pair.e[n]
                pair.g[n], pair.f[n] = phi, (1.0 if pair.mode == ACTIVE or pair.mode == DORMANT else 0.0) * phi
            else:
                force_term(pair, n, q)
        pair = pool[pairs[lo].slot]
        if RING and last > hi:
            below = pool[pairs[hi - 1].slot].f[n]
        # a second loop: the rate of a pair needs the forces of both neighbours at the same order
        for c in range(lo, hi):
            next_pair = pool[pairs[c + 1].slot] if c + 1 < last else pair
            force = pair.f[n]
            above = next_pair.f[n] if c + 1 < last else 0.0
            push = pair.lower * below - pair.inverse * force + pair.upper * above
            if n == 0:
                push += pair.pull
            if DRIVEN and pair.wall > 0:
                push += field.push[pair.wall - 1][n]
            if HUNG:
                push -= field.square * pair.x[n]
            pair.e[n + q] = step * push
            pair, below = next_pair, force
    for c in range(lo, hi):
        complete_bracket(pool[pairs[c].slot], q)


@kernel
def prepare_series(pair: Any, q: int) -> None:
    """Write coefficients below order q, and 0 for coefficients that are not computed."""
    pair.x[0], pair.e[0] = pair.xi, pair.eta
    for n in range(1, q):
        pair.x[n], pair.e[n] = 0.0, 0.0
    first = 0 if pair.mode != ACTIVE else SERIES_ORDER - q + 1
    for n in range(first, SERIES_ORDER + 1):
        pair.f[n], pair.g[n] = 0.0, 0.0
    if pair.kind != LINEAR and pair.mode != OPEN:
        for row in (pair.r, pair.z):
            for n in range(PADDED_LENGTH):
                row[n] = 0.0
        for row in (pair.gm, pair.rm, pair.zm):
            for n in range(MIRROR_LENGTH):
                row[n] = 0.0


@kernel
def force_term(pair: Any, n: int, q: int) -> None:
    """Compute order n of the force, and of φ = kξ^s + γη, under a nonlinear law.

    The pair must not be open. Its overlap is known to order n+q, its rate to order n. After an event that located φ = 0
    (`pair.exact`), φ_0 is exactly 0.
    """
    if pair.mode == DORMANT:
        return
    if pair.x[0] <= 0.0 and pair.e[0] < 0.0:  # opens at this instant, together with another pair
        pair.f[n], pair.g[n] = 0.0, pair.gamma * pair.e[0] if n == 0 else 0.0
        return
    # a pair that just touches has ξ = τ^q y
    offset = q if pair.x[0] == 0.0 else 0
    if pair.kind == ELASTIC and pair.p != 1.5:
        power_term(pair.x, pair.r, pair.p, n, offset)
        pair.f[n] = pair.k * pair.r[n]
        return
    if pair.d == 0.25 and (pair.s == 1.0 or pair.s == 1.25):  # for other s the row z is needed for ξ^s
        root_term(pair.x, pair.z, pair.zm, n + offset // 4, offset)  # √ξ starts at order q/2, its root at q/4
        root_term(pair.z, pair.r, pair.rm, n, offset // 2)
    elif pair.d == 0.5:
        root_term(pair.x, pair.r, pair.rm, n, offset)
    else:
        power_term(pair.x, pair.r, pair.d, n, offset)
    power_of_xi = pair.x[n] if pair.s == 1.0 else 0.0
    if pair.s == 1.25 and pair.d == 0.25:  # for Tsuji's law ξ^(5/4) is ξ·ξ^(1/4)
        for j in range(n + 1):
            power_of_xi += pair.x[j] * pair.r[n - j]
    elif pair.s != 1.0:
        power_term(pair.x, pair.z, pair.s, n, offset)
        power_of_xi = pair.z[n]
    phi = 0.0 if n == 0 and pair.exact else pair.k * power_of_xi + pair.gamma * pair.e[n]
    pair.g[n], pair.gm[SERIES_ORDER - n] = phi, phi
    if pair.mode == ACTIVE:
        pair.f[n] = product_term(pair.r, pair.gm, n)


@kernel
def complete_bracket(pair: Any, q: int) -> None:
    """Extend the bracket φ = kξ + γη of a pair to full order.

    The last q orders of φ do not affect the motion of this piece, but events are roots of φ. Only pairs with s = 1 have
    this form. For linear laws the force is extended as well.
    """
    if pair.mode == OPEN or pair.s != 1.0 or (pair.mode == DORMANT and pair.kind != LINEAR):
        return
    force = has_force(pair)
    for n in range(SERIES_ORDER - q + 1, SERIES_ORDER + 1):
        pair.g[n] = pair.k * pair.x[n] + pair.gamma * pair.e[n]
        if pair.kind == LINEAR:
            pair.f[n] = force * pair.g[n]


@kernel
def has_force(pair: Any) -> float:
    """Return 1.0 if the force of a pair acts (mode ACTIVE or DORMANT), else 0.0."""
    return 1.0 if pair.mode == ACTIVE or pair.mode == DORMANT else 0.0


@kernel
def expand_two_linear(a: Any, b: Any, h: float) -> None:
    """Compute the series of two linear pairs in t = hτ (q = 1).

    This is the most frequent island. The sums are the same as in `expand_series`, but in one loop for both pairs. This
    halves the time of the series in an interpreted run.
    """
    xa, ea, xb, eb = a.xi, a.eta, b.xi, b.eta
    of_a, of_b = has_force(a), has_force(b)
    ka, ga, kb, gb = of_a * a.k, of_a * a.gamma, of_b * b.k, of_b * b.gamma
    own_a, upper_a, lower_b, own_b = a.inverse, a.upper, b.lower, b.inverse
    x1, e1, f1, x2, e2, f2 = a.x, a.e, a.f, b.x, b.e, b.f
    push_a, push_b = a.pull, b.pull
    fa, fb = 0.0 if a.exact else ka * xa + ga * ea, 0.0 if b.exact else kb * xb + gb * eb
    for n in range(SERIES_ORDER + 1):
        x1[n], e1[n], f1[n], x2[n], e2[n], f2[n] = xa, ea, fa, xb, eb, fb
        step = h / (n + 1)
        xa, xb = step * ea, step * eb
        ea, eb = step * (upper_a * fb - own_a * fa + push_a), step * (lower_b * fa - own_b * fb + push_b)
        fa, fb = ka * xa + ga * ea, kb * xb + gb * eb
        # constant accelerations enter order 0 only
        push_a, push_b = 0.0, 0.0
    for pair in (a, b):
        if pair.mode == RESIDUAL:
            for n in range(SERIES_ORDER + 1):
                pair.g[n] = 0.0 if n == 0 and pair.exact else pair.k * pair.x[n] + pair.gamma * pair.e[n]


@kernel
def product_term(a: Any, mirror: Any, n: int) -> float:
    """Return coefficient n of the product of two series, Σ a_j b_(n-j).

    The second series is stored backwards: b_i = mirror[SERIES_ORDER - i].
    """
    s0, s1, s2, s3 = 0.0, 0.0, 0.0, 0.0
    for block in range(n // 8 + 1):
        j, i = (8 * block) & 31, (SERIES_ORDER - n + 8 * block) & 63  # masks prove that no index is negative
        s0 += a[j] * mirror[i] + a[j + 4] * mirror[i + 4]
        s1 += a[j + 1] * mirror[i + 1] + a[j + 5] * mirror[i + 5]
        s2 += a[j + 2] * mirror[i + 2] + a[j + 6] * mirror[i + 6]
        s3 += a[j + 3] * mirror[i + 3] + a[j + 7] * mirror[i + 7]
    return (s0 + s2) + (s1 + s3)


@kernel
def root_term(x: Any, out: Any, mirror: Any, n: int, offset: int) -> None:
    """Compute coefficient n of r = √ξ, and its copy in `mirror`.

    `x` has the coefficients of ξ, the first of which is at index `offset`, and `out` the coefficients of r. The
    recurrence is 2 r_0 r_n = ξ_n - Σ r_j r_(n-j), from r² = ξ.
    """
    first = offset // 2
    order = n - first
    if order < 0:
        return
    if order == 0:
        out[n] = math.sqrt(x[offset])
    else:
        out[n] = (x[offset + order] - product_term(out, mirror, n + first)) / (2.0 * out[first])
    mirror[SERIES_ORDER - n] = out[n]


@kernel
def power_term(x: Any, out: Any, alpha: float, n: int, offset: int) -> None:
    """Compute coefficient n of f = ξ^α, with ξ = τ^offset y.

    `x` has the coefficients of ξ, `out` the coefficients of f. For a power of y, f' y = α f y' gives
    n y_0 f_n = Σ (α j - (n-j)) y_j f_(n-j) (Knuth, TAOCP 2, 4.7).
    """
    first = int(alpha * offset + 0.5)
    order = n - first
    if order <= 0:
        out[n] = power(x[offset], alpha) if order == 0 else 0.0
        return
    total, weight = 0.0, alpha + 1.0
    for j in range(1, order + 1):
        total += (weight * j - order) * x[offset + j] * out[n - j]
    out[n] = total / (order * x[offset])

