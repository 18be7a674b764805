"""First up-crossing of a polynomial on [0, θ], certified by bounds and signs.

An up-crossing is a root at which the polynomial changes from negative to positive. A step of a soft-sphere engine is a
power series, and its events are such roots. Descartes' rule of signs in the Bernstein basis decides for each interval
whether it can contain a crossing. Newton's method is only used for a root that is proved to be the only one of its
interval. A maximum no higher than the rounding error of the polynomial, 4 (n+1) 2⁻⁵³ max |p_j θ^j|, is not an event. If
the next step then starts above zero, the event occurs immediately.

Coefficients must be finite. Rows of `work` are temporary storage. Row 0 has the coefficients of powers on [0, 1].
Rows 1, 2, … are a stack of intervals from right to left, each with its Bernstein coefficients followed by its width.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from granular._engine.kernels import kernel

Row: TypeAlias = list[float]  # compiled: a float64 array
Rows: TypeAlias = list[Row]  # compiled: a two-dimensional array

NO_ROOT = math.inf
MAX_SUBDIVISIONS = 60  # an interval of width 2⁻⁵⁵ is decided by the rounding error or by its relative width


def workspace(degree: int) -> list[list[float]]:
    """Return the rows of temporary storage for polynomials up to `degree`.

    Compiled code needs an array of the same shape.
    """
    return [[0.0] * (degree + 2) for _ in range(MAX_SUBDIVISIONS + 1)]


@kernel
def first_up_crossing(p: Row, theta: float, work: Rows, sign: float = 1.0) -> float:
    """Return the first τ in [0, θ] at which p changes from negative to positive.

    The result is `NO_ROOT` (inf) without a crossing, and 0 if p is positive just after 0.

    Parameters
    ----------
    p : sequence of floats
        Power-series coefficients, lowest first, so that p(τ) = Σ p_j τ^j. Leading coefficients that are exactly 0 are
        removed: the root of the previous event, stored as p_0 = 0, is not returned again.
    theta : float
        End θ of the interval, not negative. The search is fastest if it is the time of the earliest known event.
    work : rows of floats
        Temporary storage from `workspace`, for at least the degree of p.
    sign : float
        -1 to return the first crossing from positive to negative instead. Defaults to 1.

    Notes
    -----
    A simple root is accurate to rounding error. If another root is at a distance d, the error is about (e/p'')/d, where
    e is the rounding error of p. The coefficients of p do not allow a smaller error.
    """
    first, size = 0, len(p)
    while first < size - 1 and p[first] == 0.0:
        first += 1
    if sign * p[first] > 0.0:
        return 0.0
    s, n, power, rise, fall, negative_slope = work[0], size - 1 - first, sign, 0.0, 0.0, 0.0
    for j in range(n + 1):
        c = p[first + j] * power
        s[j] = c
        power *= theta
        if c > 0.0:
            rise += c
        else:
            fall += c
            negative_slope += j * c
    if s[0] + rise <= 0.0 or (n > 3 and _cubic_bound(s, rise) <= 0.0):
        return NO_ROOT
    noise = 4.0 * (n + 1) * 2.0**-53 * (rise - fall)
    if n > 0 and s[1] + negative_slope > n * noise and abs(rise + fall) > noise:  # increasing: at most one root
        end = rise + fall
        return theta * _polish(s, n, 0.0, 1.0, s[0] / (s[0] - end)) if end > 0.0 else NO_ROOT
    return theta * _isolate(work, n)


@kernel
def _cubic_bound(s: Row, rise: float) -> float:
    """Return an upper bound on [0, 1] of the polynomial with the coefficients `s`.

    The cubic part is bounded by its Bernstein coefficients, the rest by the sum of its positive coefficients. `rise` is
    the sum of all positive coefficients.
    """
    rest = rise - (max(0.0, s[1]) + max(0.0, s[2]) + max(0.0, s[3]))
    b1, b2 = s[0] + s[1] / 3.0, s[0] + (2.0 * s[1] + s[2]) / 3.0
    return max(max(s[0], b1), max(b2, s[0] + s[1] + s[2] + s[3])) + rest


@kernel
def _isolate(work: Rows, n: int) -> float:
    """Return the first up-crossing in [0, 1] of the polynomial in row 0 of `work`.

    Its degree is n. Intervals are examined from left to right, and halved until one contains exactly one root.
    """
    s, top, left = work[0], 1, 0.0
    noise = 4.0 * (n + 1) * 2.0**-53 * _largest(s, n)
    _bernstein(s, work[1], n)
    while top > 0:
        b = work[top]
        width = b[n + 1]
        if _highest(b, n) <= noise:  # no crossing: the polynomial is below its Bernstein coefficients
            left += width
            top -= 1
            continue
        changes = _sign_changes(b, n)
        if changes == 0 or b[0] > noise or width < 1e-15 * left or top == MAX_SUBDIVISIONS:
            return left
        if changes == 1 and b[n] > noise:  # Descartes: exactly one root
            return _polish(s, n, left, left + width, left + width * _polygon_root(b, n))
        _halve(b, work[top + 1], n)
        top += 1
    return NO_ROOT


@kernel
def _largest(s: Row, n: int) -> float:
    """Return the largest absolute value of s_0 … s_n."""
    largest = 0.0
    for j in range(n + 1):
        largest = max(largest, abs(s[j]))
    return largest


@kernel
def _highest(b: Row, n: int) -> float:
    """Return the maximum of b_0 … b_n."""
    highest = b[0]
    for i in range(1, n + 1):
        if b[i] > highest:
            highest = b[i]
    return highest


@kernel
def _sign_changes(b: Row, n: int) -> int:
    """Return the number of sign changes of the Bernstein coefficients b_0 … b_n.

    Zeros are skipped. The number of roots inside the interval is the same, or smaller by an even number.
    """
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
    """Convert coefficients of powers s on [0, 1] to Bernstein coefficients b.

    The coefficients are divided by binomials. All further operations are additions.
    """
    above, below = 1.0, 1.0  # the quotient is the binomial of n over j; separate products are faster
    for j in range(n + 1):
        b[n - j] = s[j] * below / above
        above *= n - j
        below *= j + 1
    for k in range(n, 0, -1):  # backwards in memory, which a compiler can vectorise
        for i in range(k):
            b[i] += b[i + 1]
    for i in range((n + 1) // 2):
        b[i], b[n - i] = b[n - i], b[i]
    b[n + 1] = 1.0


@kernel
def _halve(b: Row, half: Row, n: int) -> None:
    """Split an interval into halves by de Casteljau's scheme.

    `b` has the Bernstein coefficients and then the width of the interval. Afterwards `half` has the coefficients of
    the left half, and `b` the coefficients of the right half.
    """
    for k in range(n + 1):
        half[k] = b[0]
        for i in range(n - k):
            b[i] = 0.5 * (b[i] + b[i + 1])
    b[n + 1] *= 0.5
    half[n + 1] = b[n + 1]


@kernel
def _polygon_root(b: Row, n: int) -> float:
    """Return the root of the control polygon of b as a fraction of the interval.

    For large n it approximates the root of the polynomial, and is the start of Newton's method.
    """
    i = 0
    while b[i + 1] <= 0.0:
        i += 1
    return (i + b[i] / (b[i] - b[i + 1])) / n


@kernel
def _polish(s: Row, n: int, low: float, high: float, x: float) -> float:
    """Return the only root of a polynomial in [low, high] by Newton's method from x.

    `s` are the coefficients of its n + 1 powers, with s(low) ≤ 0 < s(high). A step that leaves the interval is replaced
    by bisection.
    """
    for _ in range(100):  # never reached: bisection takes 53 steps at most
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
            if abs(newton - x) <= 1e-9 * x:  # quadratic convergence: the next error is below rounding
                return newton
            x = newton
        elif high - low <= 1e-15 * high:
            return x
        else:
            x = 0.5 * (low + high)
    return x
