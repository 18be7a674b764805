"""Proof that a few pairs collide forever in a repeating collision sequence.

The proof shows that no perturbation within given bounds can break the repetition.

Let w be the vector of the rates of the pairs and g the vector of their gaps. A collision of pair c maps w linearly. For
known rates, the flight until the collision of pair c maps g linearly, ``g → g - w g_c / w_c``, if pair c closes first.
Over one period of the sequence the rates become ``R w`` and the gaps ``G(w) g``. Two conditions are tested:

* R has a leading eigenvalue 0 < λ < 1, real and simple. With its eigenvector v as rates, each pair approaches before
  its collisions.
* G(v) has a leading eigenvalue 0 < μ < λ. With its eigenvector h as gaps, all gaps stay positive except the gap of the
  colliding pair.

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
"""Number of decimal digits with which collisions are computed."""
MAX_PROOF_COLLISIONS, MAX_PERIOD = 2**13, 2**9
"""Largest number of computed collisions, and of collisions per period."""
EIGENVALUE_MARGIN, GAP_MARGIN = 1e-6, 1e-12
"""Relative margins of the leading eigenvalue and of the gaps.

The leading eigenvalue must exceed the others by `EIGENVALUE_MARGIN`. A gap must exceed its bound by `GAP_MARGIN` times
the largest gap.
"""


class Forever(NamedTuple):
    """Pairs `first` to `last` of a group, which collide forever.

    Pairs are numbered within the group. From the current state onwards, all collisions happen within `left` s.
    """

    first: int
    last: int
    left: float


def forever(pairs: Records, gap: Array, rate: Array) -> Forever | None:
    """Return which of a few neighbouring pairs provably collide forever, or None.

    `gap` (m) and `rate` (m/s) are the current values of the pairs. The module docstring gives the proof.
    """
    with localcontext() as context:
        # The exponent range holds rates far below the smallest double.
        context.prec, context.Emin, context.Emax = DECIMAL_DIGITS, -(10**9), 10**9
        shares = np.array([[Decimal(x) for x in column(pairs, name).tolist()] for name in ("low", "high", "eps")])
        group, count = Group(exact_decimals(gap), exact_decimals(rate), shares, []), 128
        while len(group.word) < MAX_PROOF_COLLISIONS and group.go_on(count):
            # Doubles the number of collisions, so that the tests cost little.
            count = min(len(group.word), MAX_PERIOD)
            word = repeated_sequence(group.word)
            first, end = min(word, default=0), max(word, default=-1) + 1
            # A pair in between that never collides, or a single pair: no proof of this kind.
            if len(set(word)) < end - first or end - first < 2:
                continue
            part = slice(first, end)
            left = time_left([c - first for c in word], shares[:, part], group.gap[part], group.rate[part])
            if left < math.inf:
                return Forever(first, end - 1, float(group.elapsed) + left)
    return None


def exact_decimals(numbers: Array) -> Any:
    """Convert floats to decimal numbers with exactly the same values."""
    return np.array([Decimal(x) for x in numbers.tolist()])


@dataclass
class Group:
    """Gaps and rates of pairs that collide only with each other.

    `word` is their collision sequence so far: the numbers of the pairs in the order of their collisions. `shares`
    contains three numbers per pair, see `collide`. `elapsed` is the time in s so far.
    """

    gap: Any
    rate: Any
    shares: Any
    word: list[int]
    elapsed: Decimal = Decimal(0)

    def go_on(self, collisions: int) -> bool:
        """Compute at most `collisions` further collisions.

        Returns whether that number of collisions happened. Otherwise all pairs separate.
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
    """Apply a collision of pair `c` to a vector of rates, in place.

    `rates` can also be a matrix whose rows belong to the pairs. `shares[:, c]` contains three numbers: the fractions
    of the change of the rate that pairs c - 1 and c + 1 receive, and the coefficient of restitution.
    """
    low, high, eps = shares[:, c]
    jump = rates[c] * (1 + eps)
    rates[c] = rates[c] * -eps
    if c > 0:
        rates[c - 1] = rates[c - 1] + low * jump
    if c + 1 < len(rates):
        rates[c + 1] = rates[c + 1] + high * jump


def repeated_sequence(log: list[int]) -> list[int]:
    """Return the shortest sequence that occurs three times in a row at the end.

    `log` is the collision sequence so far. The result is empty if no such sequence exists.
    """
    # Three repetitions, because two can occur by chance.
    for n in range(2, min(MAX_PERIOD, len(log) // 3) + 1):
        if log[-n:] == log[-2 * n : -n] == log[-3 * n : -2 * n]:
            return log[-n:]
    return []


class LeadingEigenvalue(NamedTuple):
    """Leading eigenvalue of a matrix, its eigenvectors and bounds.

    The eigenvalue is real, positive and simple. The scalar product of the left and the right eigenvector is 1. The
    norms of ``(matrix / value)ⁿ``, n = 0, 1, …, are taken on the subspace complementary to the right eigenvector:
    `most` is the largest norm, and `total` is the sum of all norms.
    """

    value: Any
    right: Any
    left: Any
    most: float
    total: float

    def split(self, vector: Any) -> tuple[Any, float]:
        """Split a vector into its component along the right eigenvector and a remainder.

        Returns the coefficient of the eigenvector, and the largest entry of the remainder divided by this coefficient.
        """
        coefficient = self.left @ vector
        return coefficient, float(abs(vector / coefficient - self.right).max()) if coefficient > 0 else math.inf


def leading_eigenvalue(matrix: Any, like: Any) -> LeadingEigenvalue | None:
    """Return the leading eigenvalue of a matrix with its eigenvectors, or None.

    The sign of the eigenvectors is chosen such that the vector `like` has a positive component along the right
    eigenvector. The result is None if the eigenvalue is not real, positive and simple.
    """
    magnitudes = -np.sort(-np.abs(np.linalg.eigvals(matrix.astype(float))))
    if not magnitudes[1] < (1.0 - EIGENVALUE_MARGIN) * magnitudes[0]:
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
    complement = np.eye(len(right)) - np.outer(right, left).astype(float)
    scaled, power, norms = (matrix / value).astype(float), complement, [max_norm(complement)]
    # A norm of at most ½ bounds all further norms by a geometric series.
    while value > 0 and norms[-1] > 0.5 and len(norms) < MAX_PROOF_COLLISIONS:
        power = scaled @ power
        norms.append(max_norm(power))
    if not (value > 0 and norms[-1] <= 0.5):
        return None
    # The last norm is at most ½: as many further norms add at most half of the sum, then a quarter, …
    return LeadingEigenvalue(value, right, left, max(norms), 2.0 * sum(norms))


def max_norm(matrix: Array) -> Any:
    """Return the matrix norm induced by the maximum norm, for each matrix of a stack."""
    return np.abs(matrix).sum(axis=-1).max(axis=-1)


def time_left(word: list[int], shares: Any, gap: Any, rate: Any) -> float:
    """Return an upper bound of the time in s of all repetitions of a sequence.

    `word` is the collision sequence of one period, and `gap` (m) and `rate` (m/s) are the state at its beginning. The
    result is inf if the proof fails.
    """
    turns, period = rate_matrices(word, shares)
    of_rates = leading_eigenvalue(period, rate)
    if of_rates is None or not of_rates.value < 1:
        return math.inf
    rates = turns @ of_rates.right
    if not all(w[c] < 0 for w, c in zip(rates, word, strict=True)):
        return math.inf
    gaps = gap_matrices(word, rates)
    of_gaps = leading_eigenvalue(gaps[-1], gap)
    if of_gaps is None or not of_gaps.value < of_rates.value:
        return math.inf
    (rate_scale, delta), (gap_scale, zeta) = of_rates.split(rate), of_gaps.split(gap)
    if not max(delta, zeta) < math.inf:
        return math.inf
    # Bound of G(v+δ) - G(v).
    drift = gap_matrix_changes(
        word, turns.astype(float), rates.astype(float), gaps.astype(float), of_rates.most * delta)
    bound = float(abs(of_gaps.left).sum()) + of_gaps.most  # bound of all powers of G(v) / μ
    # Sum of the relative changes over all periods. Π(1+a_n) ≤ exp Σ a_n, hence expm1 below.
    total_change = bound * drift[-1] / float(of_gaps.value) * (of_rates.total / of_rates.most)
    # Also rejects nan.
    if not total_change < 1.0:
        return math.inf
    deviation = of_gaps.most * zeta + bound * math.expm1(total_change) * (1.0 + zeta)
    after = (gaps @ of_gaps.right).astype(float)
    # Contributions of ζ, of δ and of rounding.
    uncertainty = (max_norm(gaps.astype(float)) * deviation + drift * (1.0 + deviation)
                   + GAP_MARGIN * np.abs(after).max(axis=1))
    # The pair that has just collided has gap 0.
    after[np.arange(len(word)), word] = math.inf
    if not (after.min(axis=1) > uncertainty).all():
        return math.inf
    before = [of_gaps.right, *(gaps[:-1] @ of_gaps.right)]
    first_period = sum(-g[c] / w[c] for g, w, c in zip(before, rates, word, strict=True)) * gap_scale / rate_scale
    # Geometric series in μ/λ, doubled for the cone.
    return 2.0 * float(first_period / (1 - of_gaps.value / of_rates.value))


def rate_matrices(word: list[int], shares: Any) -> tuple[Any, Any]:
    """Return the matrices from initial rates to rates before each collision, and R.

    R is the matrix of the whole period. `word` contains the numbers of the pairs that collide in it, in order.
    """
    turn, turns = exact_decimals(np.eye(shares.shape[1]).ravel()).reshape(shares.shape[1], -1), []
    for c in word:
        turns.append(turn.copy())
        collide(turn, c, shares)
    return np.array(turns), turn


def gap_matrices(word: list[int], rates: Any) -> Any:
    """Return the matrices that map initial gaps to the gaps at each collision.

    `rates` are the rates before each collision of the period `word`. The last matrix is G.
    """
    gap, gaps = exact_decimals(np.eye(rates.shape[1]).ravel()).reshape(rates.shape[1], -1), []
    for w, c in zip(rates, word, strict=True):
        gap = gap - np.outer(w / w[c], gap[c])
        gap[c] = Decimal(0)
        gaps.append(gap)
    return np.array(gaps)


def gap_matrix_changes(word: list[int], turns: Array, rates: Array, gaps: Array, delta: float) -> Array:
    """Return a bound of the change of each gap matrix by a perturbation of the rates.

    The initial rates v change by at most `delta`. The matrices `turns` and `gaps` and the rates `rates` belong to the
    unperturbed period `word`. The result is a norm per matrix, or inf if a rate can change its sign. The change is
    ``D_i = Σ_j F_i … F_(j+1) E_j (gaps_(j-1) + D_(j-1))``, where F_j is the matrix of a flight and E_j its change.
    """
    count, k = rates.shape
    closing, deviation, largest = -rates[np.arange(count), word], max_norm(turns) * delta, np.abs(rates).max(axis=1)
    # Then the denominator closing - off is at least half of closing.
    if not (deviation < 0.5 * closing).all():
        return np.full(count, math.inf)
    # A perturbation δ of w changes w/w_c by (δ w_c - w δ_c)/(w_c (w_c + δ_c)), at most by this value.
    flight_change = deviation * (closing + largest) / (closing * (closing - deviation))
    # The products F_i … F_(j+1) for every j so far.
    sizes, products, drift = [1.0, *max_norm(gaps)], np.zeros((0, k, k)), [0.0]
    for i, c in enumerate(word):
        products = products + (rates[i] / closing[i])[:, None] * products[:, c, None, :]
        products[:, c] = 0.0
        products = np.concatenate([products, np.eye(k)[None]])
        weight = flight_change[: i + 1] * (np.array(sizes[: i + 1]) + np.array(drift))
        drift.append(float(max_norm(products) @ weight))
    return np.array(drift[1:])
