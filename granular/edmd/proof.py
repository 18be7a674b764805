"""A proof that a few pairs collide forever: the word of their collisions repeats, and nothing can break it.

A collision of pair c maps the rates w of the pairs linearly, and a wait maps their gaps g linearly once the rates are
known, ``g → g - w g_c / w_c``: pair c closes first. Over one word of collisions the rates become ``R w`` and the gaps
``G(w) g``. Let R have a leading eigenvalue 0 < λ < 1, real and simple, whose vector v closes each pair at its turn, and
G(v) one, 0 < μ < λ, whose vector h leaves every gap open but the one that closes. Then (h, v) repeats itself, smaller
by μ and λ, so all its collisions take a finite time. And what starts near it stays near it: with ``w = v + δ`` and
``g = h + ζ`` bounds on ``(R/λ)ⁿ δ``, on ``G(v + δ) - G(v)`` and on ``(G/μ)ⁿ ζ`` for all n show that no rate and no gap
ever changes its sign. These (ζ, δ) are a cone about (h, v) that every word maps into itself.

The state, as its numbers are, is followed in `DIGITS` digits until it lies in the cone. Bounds are computed in double
precision with a margin, not in interval arithmetic. Assumed: constant restitution, no accelerations among these pairs,
and that nobody from outside hits them in the time that is left, which is returned for the caller to look at.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Decimal, localcontext
from typing import Any, NamedTuple

import numpy as np

from granular._engine.check import Array
from granular._engine.records import Records, column

DIGITS = 60
"""Digits in which collisions are followed."""
MOST, LONGEST = 2**13, 2**9
"""Collisions followed at most; those of the longest word."""
MARGIN, ROUNDING = 1e-6, 1e-12
"""Parts by which the leading eigenvalue must exceed the others, and a gap, in units of the largest, its bound."""


class Forever(NamedTuple):
    """Pairs `first` … `last`, numbered in the group, collide forever, all within `left` seconds."""

    first: int
    last: int
    left: float


def forever(pairs: Records, gap: Array, rate: Array) -> Forever | None:
    """Return which of a few neighbours collide forever, if that can be proved: see the head of this file."""
    with localcontext() as context:
        context.prec, context.Emin, context.Emax = DIGITS, -(10**9), 10**9
        shares = np.array([[Decimal(x) for x in column(pairs, name).tolist()] for name in ("low", "high", "eps")])
        group, more = Group(exact(gap), exact(rate), shares, []), 128
        while len(group.word) < MOST and group.go_on(more):
            more = min(len(group.word), LONGEST)
            word = repeated(group.word)
            first, end = min(word, default=0), max(word, default=-1) + 1
            if len(set(word)) < end - first or end - first < 2:
                continue
            part = slice(first, end)
            left = time_left([c - first for c in word], shares[:, part], group.gap[part], group.rate[part])
            if left < math.inf:
                return Forever(first, end - 1, float(group.elapsed) + left)
    return None


def exact(numbers: Array) -> Any:
    """Return numbers as they are, with more digits to come."""
    return np.array([Decimal(x) for x in numbers.tolist()])


@dataclass
class Group:
    """Gaps and rates of pairs that only meet each other, and the word they have spelt."""

    gap: Any
    rate: Any
    shares: Any
    word: list[int]
    elapsed: Decimal = Decimal(0)

    def go_on(self, collisions: int) -> bool:
        """Let so many collisions happen; return whether there were so many."""
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
    """Let pair `c` collide: change rates, or the rows of the matrix that gives them."""
    low, high, eps = shares[:, c]
    jump = rates[c] * (1 + eps)
    rates[c] = rates[c] * -eps
    if c > 0:
        rates[c - 1] = rates[c - 1] + low * jump
    if c + 1 < len(rates):
        rates[c + 1] = rates[c + 1] + high * jump


def repeated(log: list[int]) -> list[int]:
    """Return the shortest word that the last collisions are three times over; empty if there is none."""
    for n in range(2, min(LONGEST, len(log) // 3) + 1):
        if log[-n:] == log[-2 * n : -n] == log[-3 * n : -2 * n]:
            return log[-n:]
    return []


class Leading(NamedTuple):
    """The leading eigenvalue of a matrix, real, positive and simple; its right and left vector, product 1; the norms
    ``|(matrix / value)ⁿ|`` beside this vector: the largest, and their sum, over n = 0, 1, … to infinity."""

    value: Any
    right: Any
    left: Any
    most: float
    total: float

    def off(self, vector: Any) -> tuple[Any, float]:
        """Return how much of the right vector there is in a vector, and what is beside it, in units of that."""
        part = self.left @ vector
        return part, float(abs(vector / part - self.right).max()) if part > 0 else math.inf


def leading(matrix: Any, like: Any) -> Leading | None:
    """Return what leads, its right vector on the side of `like`; None if it is not real, positive and simple."""
    sizes = -np.sort(-np.abs(np.linalg.eigvals(matrix.astype(float))))
    if not sizes[1] < (1.0 - MARGIN) * sizes[0]:
        return None
    power = matrix / abs(matrix).max()  # its 2³⁰th power is right times left, all else has died out
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
    while value > 0 and norms[-1] > 0.5 and len(norms) < MOST:
        power = once @ power
        norms.append(size(power))
    if not (value > 0 and norms[-1] <= 0.5):
        return None
    # the last is at most ½: so many more add at most half of that sum, then a quarter, …
    return Leading(value, right, left, max(norms), 2.0 * sum(norms))


def size(matrix: Array) -> Any:
    """Return the norm of a matrix, or of each of a stack, that belongs to the largest entry of a vector."""
    return np.abs(matrix).sum(axis=-1).max(axis=-1)


def time_left(word: list[int], shares: Any, gap: Any, rate: Any) -> float:
    """Return a time in s within which gaps and rates at the beginning of a word spell it forever; inf if no proof."""
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
    # bound of G(v+δ) - G(v)
    drift = drifted(word, turns.astype(float), rates.astype(float), gaps.astype(float), of_rates.most * delta)
    bound = float(abs(of_gaps.left).sum()) + of_gaps.most  # on all powers of G(v) / μ
    # Σ over words of the relative change: Π(1+a_n) ≤ exp Σ a_n, hence expm1 below
    ever = bound * drift[-1] / float(of_gaps.value) * (of_rates.total / of_rates.most)
    if not ever < 1.0:
        return math.inf
    off = of_gaps.most * zeta + bound * math.expm1(ever) * (1.0 + zeta)
    after = (gaps @ of_gaps.right).astype(float)
    # ζ carried through, δ, rounding
    doubt = size(gaps.astype(float)) * off + drift * (1.0 + off) + ROUNDING * np.abs(after).max(axis=1)
    after[np.arange(len(word)), word] = math.inf
    if not (after.min(axis=1) > doubt).all():
        return math.inf
    before = [of_gaps.right, *(gaps[:-1] @ of_gaps.right)]
    once = sum(-g[c] / w[c] for g, w, c in zip(before, rates, word, strict=True)) * near / slow
    # geometric series in μ/λ, doubled for the cone
    return 2.0 * float(once / (1 - of_gaps.value / of_rates.value))


def turned(word: list[int], shares: Any) -> tuple[Any, Any]:
    """Return the matrices that make the rates before each collision of a word of those at its beginning, and R."""
    turn, turns = exact(np.eye(shares.shape[1]).ravel()).reshape(shares.shape[1], -1), []
    for c in word:
        turns.append(turn.copy())
        collide(turn, c, shares)
    return np.array(turns), turn


def waited(word: list[int], rates: Any) -> Any:
    """Return the matrices that make the gaps after each wait of a word of those at its beginning; the last is G."""
    gap, gaps = exact(np.eye(rates.shape[1]).ravel()).reshape(rates.shape[1], -1), []
    for w, c in zip(rates, word, strict=True):
        gap = gap - np.outer(w / w[c], gap[c])
        gap[c] = Decimal(0)
        gaps.append(gap)
    return np.array(gaps)


def drifted(word: list[int], turns: Array, rates: Array, gaps: Array, delta: float) -> Array:
    """Return by how much (norm) each matrix of the gaps may change if v is off by `delta`; inf if rates change sign.

    ``D_i = Σ_j F_i … F_(j+1) E_j (gaps_(j-1) + D_(j-1))`` with F_j what a wait does and E_j the change of it.
    """
    count, k = rates.shape
    closing, off, largest = -rates[np.arange(count), word], size(turns) * delta, np.abs(rates).max(axis=1)
    if not (off < 0.5 * closing).all():
        return np.full(count, math.inf)
    # w/w_c with w off by δ changes by (δ w_c - w δ_c)/(w_c (w_c + δ_c)): at most this
    of_wait = off * (closing + largest) / (closing * (closing - off))
    # F_i … F_(j+1) for every j so far
    sizes, products, drift = [1.0, *size(gaps)], np.zeros((0, k, k)), [0.0]
    for i, c in enumerate(word):
        products = products + (rates[i] / closing[i])[:, None] * products[:, c, None, :]
        products[:, c] = 0.0
        products = np.concatenate([products, np.eye(k)[None]])
        weight = of_wait[: i + 1] * (np.array(sizes[: i + 1]) + np.array(drift))
        drift.append(float(size(products) @ weight))
    return np.array(drift[1:])
