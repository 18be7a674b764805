"""Proof that a few pairs collide forever in a repeating collision sequence.

The proof shows that no perturbation within given bounds can break the repetition.

A collision of pair c maps the rates w of the pairs linearly. For known rates, a wait maps the gaps g linearly,
``g → g - w g_c / w_c``, if pair c closes first. Over one period of the sequence the rates become ``R w`` and the gaps
``G(w) g``. Two assumptions are tested:

* R has a leading eigenvalue 0 < λ < 1, real and simple, whose vector v closes each pair at its turn.
* G(v) has a leading eigenvalue 0 < μ < λ, whose vector h keeps every gap open except the closing gap.

Then (h, v) repeats itself, scaled by μ and λ, so all its collisions take a finite time. Nearby states stay near (h, v).
With ``w = v + δ`` and ``g = h + ζ``, bounds on ``(R/λ)ⁿ δ``, on ``G(v + δ) - G(v)`` and on ``(G/μ)ⁿ ζ`` for all n show
that no rate and no gap ever changes its sign. These (ζ, δ) form a cone about (h, v) that every period maps into itself.

The state is followed in `DECIMAL_DIGITS` digits, starting from its exact binary values, until it lies in the cone.
Bounds are computed in double precision with a margin, not in interval arithmetic. The proof assumes constant
restitution, no accelerations between these pairs, and no hit from outside during the remaining time. This time is
returned, and the caller has to check it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array
from granular._engine.records import Records, column

DECIMAL_DIGITS = 60
"""Decimal digits in which collisions are followed."""
MAX_PROOF_COLLISIONS, MAX_PERIOD = 2**13, 2**9
"""Largest number of collisions followed, and of collisions per period."""
EIGENVALUE_MARGIN, GAP_MARGIN = 1e-6, 1e-12
"""Relative margins of the leading eigenvalue and of the gaps.

The leading eigenvalue must exceed the others by `EIGENVALUE_MARGIN`. A gap must exceed its bound by `GAP_MARGIN` times
the largest gap.
"""


class Forever(NamedTuple):
    """Pairs `first` to `last`, numbered within the group, that collide forever.

    All collisions happen within `left` seconds.
    """

    first: int
    last: int
    left: float


def forever(pairs: Records, gap: Array, rate: Array) -> Forever | None:
    """Return which of a few neighbouring pairs provably collide forever, or None.

    The module docstring gives the proof.
    """
    with localcontext() as context:
        # The exponent range holds rates far below the smallest double.
        context.prec, context.Emin, context.Emax = DECIMAL_DIGITS, -(10**9), 10**9
        shares = np.array([[Decimal(x) for x in column(pairs, name).tolist()] for name in ("low", "high", "eps")])
        group, more = Group(exact(gap), exact(rate), shares, []), 128
        while len(group.word) < MAX_PROOF_COLLISIONS and group.go_on(more):
            # Doubles the number of collisions, so that the tests cost little.
            more = min(len(group.word), MAX_PERIOD)
            word = repeated(group.word)
            first, end = min(word, default=0), max(word, default=-1) + 1
            # A pair in between that never collides, or a single pair: no proof of this kind.
            if len(set(word)) < end - first or end - first < 2:
                continue
            part = slice(first, end)
            left = time_left([c - first for c in word], shares[:, part], group.gap[part], group.rate[part])
            if left < math.inf:
                return Forever(first, end - 1, float(group.elapsed) + left)
    return None


def exact(numbers: Array) -> Any:
    """Convert floats to decimals with the same values."""
    return np.array([Decimal(x) for x in numbers.tolist()])


@dataclass
class Group:
    """Gaps and rates of pairs that collide only with each other, and their sequence.

    `word` lists the numbers of the pairs in the order of their collisions.
    """

    gap: Any
    rate: Any
    shares: Any
    word: list[int]
    elapsed: Decimal = Decimal(0)

    def go_on(self, collisions: int) -> bool:
        """Let at most `collisions` collisions happen.

        Returns whether all of them happened.
        """
        for _ in range(collisions):
            closing = [(-g / w, c) for c, (g, w) in enumerate(zip(self.gap, self.rate, strict=True)) if w < 0]
            if not closing:
                return False
            wait, c = min(closing)
            self.gap = np.array([max(g + wait * w, Decimal(0)) for g, w in zip(self.gap, self.rate, strict=True)])
            self.gap[c] = Decimal(0)
            collide(self.rate, c, self.shares)
            self.word.append(c)
            self.elapsed += wait
        return True


def collide(rates: Any, c: int, shares: Any) -> None:
    """Apply a collision of pair `c` to the rates, or to the rows of a matrix of rates.

    `shares[:, c]` contains the shares of the change that the pairs below and above receive, and the coefficient of
    restitution.
    """
    low, high, eps = shares[:, c]
    jump = rates[c] * (1 + eps)
    rates[c] = rates[c] * -eps
    if c > 0:
        rates[c - 1] = rates[c - 1] + low * jump
    if c + 1 < len(rates):
        rates[c + 1] = rates[c + 1] + high * jump


def repeated(log: list[int]) -> list[int]:
    """Return the shortest sequence that the last collisions repeat three times.

    Without such a sequence the list is empty.
    """
    # Three repetitions, because two can occur by chance.
    for n in range(2, min(MAX_PERIOD, len(log) // 3) + 1):
        if log[-n:] == log[-2 * n : -n] == log[-3 * n : -2 * n]:
            return log[-n:]
    return []


class Leading(NamedTuple):
    """Leading eigenvalue of a matrix, its eigenvectors and bounds.

    The eigenvalue is real, positive and simple. The product of the right and the left eigenvector is 1. The norms of
    ``(matrix / value)ⁿ``, n = 0, 1, …, are taken on the subspace complementary to the right eigenvector: `most` is the
    largest norm, and `total` is the sum of all norms.
    """

    value: Any
    right: Any
    left: Any
    most: float
    total: float

    def off(self, vector: Any) -> tuple[Any, float]:
        """Split a vector into its part along the right eigenvector and the rest.

        Returns the coefficient of the eigenvector, and the largest entry of the rest divided by this coefficient.
        """
        part = self.left @ vector
        return part, float(abs(vector / part - self.right).max()) if part > 0 else math.inf


def leading(matrix: Any, like: Any) -> Leading | None:
    """Return the leading eigenvalue with its vectors, or None.

    The right eigenvector points to the side of `like`. The result is None if the eigenvalue is not real, positive and
    simple.
    """
    sizes = -np.sort(-np.abs(np.linalg.eigvals(matrix.astype(float))))
    if not sizes[1] < (1.0 - EIGENVALUE_MARGIN) * sizes[0]:
        return None
    power = matrix / abs(matrix).max()  # its 2³⁰th power is right times left: (1 - MARGIN)^(2³⁰) vanishes
    for _ in range(30):
        power = power @ power
        power = power / abs(power).max()
    row, at = np.unravel_index(np.argmax(abs(power)), power.shape)
    right, left = power[:, at] / power[row, at], power[row]
    right, left = (right, left) if left @ like > 0 else (-right, -left)
    left = left / (left @ right)
    value = left @ (matrix @ right)
    beside = np.eye(len(right)) - np.outer(right, left).astype(float)
    once, power, norms = (matrix / value).astype(float), beside, [size(beside)]
    # A norm of at most ½ bounds all further norms by a geometric series.
    while value > 0 and norms[-1] > 0.5 and len(norms) < MAX_PROOF_COLLISIONS:
        power = once @ power
        norms.append(size(power))
    if not (value > 0 and norms[-1] <= 0.5):
        return None
    # The last norm is at most ½: as many further norms add at most half of the sum, then a quarter, …
    return Leading(value, right, left, max(norms), 2.0 * sum(norms))


def size(matrix: Array) -> Any:
    """Return the matrix norm induced by the maximum norm, for each matrix of a stack."""
    return np.abs(matrix).sum(axis=-1).max(axis=-1)


def time_left(word: list[int], shares: Any, gap: Any, rate: Any) -> float:
    """Return an upper bound of the time in s of all repetitions of `word`.

    `gap` and `rate` are the state at the beginning of a period. The result is inf if the proof fails.
    """
    turns, whole = turned(word, shares)
    of_rates = leading(whole, rate)
    if of_rates is None or not of_rates.value < 1:
        return math.inf
    rates = turns @ of_rates.right
    if not all(w[c] < 0 for w, c in zip(rates, word, strict=True)):
        return math.inf
    gaps = waited(word, rates)
    of_gaps = leading(gaps[-1], gap)
    if of_gaps is None or not of_gaps.value < of_rates.value:
        return math.inf
    (slow, delta), (near, zeta) = of_rates.off(rate), of_gaps.off(gap)
    if not max(delta, zeta) < math.inf:
        return math.inf
    # Bound of G(v+δ) - G(v).
    drift = drifted(word, turns.astype(float), rates.astype(float), gaps.astype(float), of_rates.most * delta)
    bound = float(abs(of_gaps.left).sum()) + of_gaps.most  # bound of all powers of G(v) / μ
    # Sum of the relative changes over all periods. Π(1+a_n) ≤ exp Σ a_n, hence expm1 below.
    ever = bound * drift[-1] / float(of_gaps.value) * (of_rates.total / of_rates.most)
    # Also rejects nan.
    if not ever < 1.0:
        return math.inf
    off = of_gaps.most * zeta + bound * math.expm1(ever) * (1.0 + zeta)
    after = (gaps @ of_gaps.right).astype(float)
    # Contributions of ζ, of δ and of rounding.
    doubt = size(gaps.astype(float)) * off + drift * (1.0 + off) + GAP_MARGIN * np.abs(after).max(axis=1)
    # The pair that has just collided has gap 0.
    after[np.arange(len(word)), word] = math.inf
    if not (after.min(axis=1) > doubt).all():
        return math.inf
    before = [of_gaps.right, *(gaps[:-1] @ of_gaps.right)]
    once = sum(-g[c] / w[c] for g, w, c in zip(before, rates, word, strict=True)) * near / slow
    # Geometric series in μ/λ, doubled for the cone.
    return 2.0 * float(once / (1 - of_gaps.value / of_rates.value))


def turned(word: list[int], shares: Any) -> tuple[Any, Any]:
    """Return the matrices that map initial rates to the rates before each collision.

    The second value is R, the matrix of the whole period.
    """
    turn, turns = exact(np.eye(shares.shape[1]).ravel()).reshape(shares.shape[1], -1), []
    for c in word:
        turns.append(turn.copy())
        collide(turn, c, shares)
    return np.array(turns), turn


def waited(word: list[int], rates: Any) -> Any:
    """Return the matrices that map initial gaps to the gaps after each wait.

    The last matrix is G.
    """
    gap, gaps = exact(np.eye(rates.shape[1]).ravel()).reshape(rates.shape[1], -1), []
    for w, c in zip(rates, word, strict=True):
        gap = gap - np.outer(w / w[c], gap[c])
        gap[c] = Decimal(0)
        gaps.append(gap)
    return np.array(gaps)


def drifted(word: list[int], turns: Array, rates: Array, gaps: Array, delta: float) -> Array:
    """Bound the change of each gap matrix if v is perturbed by at most `delta`.

    The result is a norm per matrix, or inf if a rate can change its sign.
    ``D_i = Σ_j F_i … F_(j+1) E_j (gaps_(j-1) + D_(j-1))``, where F_j is the matrix of a wait and E_j its change.
    """
    count, k = rates.shape
    closing, off, largest = -rates[np.arange(count), word], size(turns) * delta, np.abs(rates).max(axis=1)
    # Then the denominator closing - off is at least half of closing.
    if not (off < 0.5 * closing).all():
        return np.full(count, math.inf)
    # A perturbation δ of w changes w/w_c by (δ w_c - w δ_c)/(w_c (w_c + δ_c)), at most by this value.
    of_wait = off * (closing + largest) / (closing * (closing - off))
    # The products F_i … F_(j+1) for every j so far.
    sizes, products, drift = [1.0, *size(gaps)], np.zeros((0, k, k)), [0.0]
    for i, c in enumerate(word):
        products = products + (rates[i] / closing[i])[:, None] * products[:, c, None, :]
        products[:, c] = 0.0
        products = np.concatenate([products, np.eye(k)[None]])
        weight = of_wait[: i + 1] * (np.array(sizes[: i + 1]) + np.array(drift))
        drift.append(float(size(products) @ weight))
    return np.array(drift[1:])
