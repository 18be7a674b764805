"""First up-crossing of a polynomial on [0, θ], certified: found by bounds and signs, never by sampling.

A step of a soft-sphere engine is a power series, an event its first root where it goes from - to +. Descartes' rule
of signs in the Bernstein basis decides on every interval whether a crossing can be there; Newton's method only
polishes a root that is known to be the only one. Not an event is a hump no higher than the rounding noise of the
polynomial itself, 4 (n+1) 2⁻⁵³ max |p_j θ^j|; should the next piece then start above zero, it fires at once.

Coefficients must be finite. Rows of `work` are scratch: row 0 holds the power form on [0, 1], rows 1, 2, … a stack of
intervals from right to left, each as its Bernstein coefficients followed by its width.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from granular._engine.kernels import kernel

Row: TypeAlias = list[float]  # compiled: a float64 array
Rows: TypeAlias = list[Row]  # compiled: a two-dimensional array

NEVER = math.inf
DEEPEST = 60  # an interval 2⁻⁵⁵ wide is already decided by noise or by its relative width


def workspace(degree: int) -> list[list[float]]:
    """Return scratch for polynomials up to `degree`; compiled code takes an array of that shape."""
    return [[0.0] * (degree + 2) for _ in range(DEEPEST + 1)]


@kernel
def first_up_crossing(p: Row, theta: float, work: Rows, sign: float = 1.0) -> float:
    """Return the first τ in [0, θ] where p goes from negative to positive, `NEVER` (inf) if there is none.

    Parameters
    ----------
    p : sequence of floats
        Power-series coefficients, lowest first, so that p(τ) = Σ p_j τ^j. Exact zeros at the front are divided out:
        a root just left, written as p_0 = 0, is not found again. If p is positive right after 0, the answer is 0.
    theta : float
        End of the interval, not negative: best the earliest event found so far.
    work : rows of floats
        Scratch from `workspace`, for at least the degree of p.
    sign : float
        -1 to look for the first crossing from positive to negative instead.

    Notes
    -----
    A root at which p is far from flat is right to rounding. One of two roots a distance d apart is right to
    about (noise/p'')/d, which is the most p's coefficients can tell.
    """
    first, size = 0, len(p)
    while first < size - 1 and p[first] == 0.0:
        first += 1
    if sign * p[first] > 0.0:
        return 0.0
    s, n, power, rise, fall, drag = work[0], size - 1 - first, sign, 0.0, 0.0, 0.0
    for j in range(n + 1):
        c = p[first + j] * power
        s[j] = c
        power *= theta
        if c > 0.0:
            rise += c
        else:
            fall += c
            drag += j * c
    if s[0] + rise <= 0.0 or (n > 3 and _cubic_bound(s, rise) <= 0.0):
        return NEVER
    noise = 4.0 * (n + 1) * 2.0**-53 * (rise - fall)
    if n > 0 and s[1] + drag > n * noise and abs(rise + fall) > noise:  # the slope is positive all the way
        end = rise + fall
        return theta * _polish(s, n, 0.0, 1.0, s[0] / (s[0] - end)) if end > 0.0 else NEVER
    return theta * _isolate(work, n)


@kernel
def _cubic_bound(s: Row, rise: float) -> float:
    """Return a bound on [0, 1]: the cubic part by Bernstein coefficients, and the positive rest (`rise` is all)."""
    late = rise - (max(0.0, s[1]) + max(0.0, s[2]) + max(0.0, s[3]))
    third, two = s[0] + s[1] / 3.0, s[0] + (2.0 * s[1] + s[2]) / 3.0
    return max(max(s[0], third), max(two, s[0] + s[1] + s[2] + s[3])) + late


@kernel
def _isolate(work: Rows, n: int) -> float:
    """Return the first up-crossing in [0, 1] of the power form in row 0, taking intervals from left to right."""
    s, top, left = work[0], 1, 0.0
    noise = 4.0 * (n + 1) * 2.0**-53 * _largest(s, n)
    _bernstein(s, work[1], n)
    while top > 0:
        b = work[top]
        width = b[n + 1]
        if _highest(b, n) <= noise:
            left += width
            top -= 1
            continue
        changes = _sign_changes(b, n)
        if changes == 0 or b[0] > noise or width < 1e-15 * left or top == DEEPEST:
            return left
        if changes == 1 and b[n] > noise:
            return _polish(s, n, left, left + width, left + width * _polygon_root(b, n))
        _halve(b, work[top + 1], n)
        top += 1
    return NEVER


@kernel
def _largest(s: Row, n: int) -> float:
    largest = 0.0
    for j in range(n + 1):
        largest = max(largest, abs(s[j]))
    return largest


@kernel
def _highest(b: Row, n: int) -> float:
    highest = b[0]
    for i in range(1, n + 1):
        if b[i] > highest:
            highest = b[i]
    return highest


@kernel
def _sign_changes(b: Row, n: int) -> int:
    """Count the sign changes of b_0 … b_n, skipping zeros: the number of roots inside, or more by an even number."""
    changes, last = 0, 0.0
    for i in range(n + 1):
        c = b[i]
        if c != 0.0:
            if last * c < 0.0:
                changes += 1
            last = 1.0 if c > 0.0 else -1.0
    return changes


@kernel
def _bernstein(s: Row, b: Row, n: int) -> None:
    """Turn the power form s on [0, 1] into Bernstein coefficients: divide by binomials, then only add."""
    above, below = 1.0, 1.0  # their quotient is the binomial of n over j; apart, they do not wait for each other
    for j in range(n + 1):
        b[n - j] = s[j] * below / above
        above *= n - j
        below *= j + 1
    for k in range(n, 0, -1):  # backwards in memory, so that a compiler can add several at once
        for i in range(k):
            b[i] += b[i + 1]
    for i in range((n + 1) // 2):
        b[i], b[n - i] = b[n - i], b[i]
    b[n + 1] = 1.0


@kernel
def _halve(b: Row, half: Row, n: int) -> None:
    """Split by de Casteljau's scheme: the left half goes to `half`, the right half stays in `b`."""
    for k in range(n + 1):
        half[k] = b[0]
        for i in range(n - k):
            b[i] = 0.5 * (b[i] + b[i + 1])
    b[n + 1] *= 0.5
    half[n + 1] = b[n + 1]


@kernel
def _polygon_root(b: Row, n: int) -> float:
    """Return where the control polygon of b crosses zero, as a share of the interval: near the root for large n."""
    i = 0
    while b[i + 1] <= 0.0:
        i += 1
    return (i + b[i] / (b[i] - b[i + 1])) / n


@kernel
def _polish(s: Row, n: int, low: float, high: float, x: float) -> float:
    """Return the one root in [low, high], s(low) ≤ 0 < s(high), by Newton's method from x, kept inside by halving."""
    for _ in range(100):
        value, slope = s[n], 0.0
        for j in range(n - 1, -1, -1):
            slope = slope * x + value
            value = value * x + s[j]
        if value < 0.0:
            low = x
        else:
            high = x
        newton = x - value / slope if slope > 0.0 else -1.0
        if low <= newton <= high:
            if abs(newton - x) <= 1e-9 * x:
                return newton
            x = newton
        elif high - low <= 1e-15 * high:
            return x
        else:
            x = 0.5 * (low + high)
    return x
