"""Where a row is largest within a piece, and whether a bound says so at once, against the roots of its slope."""

from __future__ import annotations

import math

import numpy as np

from granular._engine.roots import workspace
from granular.md.located.peaks import largest_local_maximum, monotonic_sign
from granular.md.located.pieces import value
from granular.md.located.records import SERIES_ORDER

WORK = workspace(SERIES_ORDER)


def drawn(seed: int) -> tuple[list[float], float]:
    """Coefficients that fall off like those of a step, in any order of sign, some of them steep at first; an end."""
    random = np.random.default_rng(seed)
    fall = random.uniform(0.2, 1.5) ** np.arange(SERIES_ORDER + 1) / [
        math.factorial(j) for j in range(SERIES_ORDER + 1)
    ]
    row = random.normal(size=SERIES_ORDER + 1) * fall * 10.0 ** -random.integers(0, 3)
    row[1] *= 10.0 ** random.integers(0, 3)
    return row.tolist(), float(random.choice([0.01, 0.5, 1.0, 3.0]))


def test_a_heading_is_never_wrong_and_a_summit_is_the_largest_that_is_no_end():
    """A row with a heading is monotone; where it turns down, the largest value is found; both cases are met."""
    met = set()
    for seed in range(300):
        row, tau = drawn(seed)
        slope = np.polynomial.Polynomial(row).deriv()
        at = slope.roots()
        turns = np.sort(at.real[(np.abs(at.imag) < 1e-9) & (at.real > 1e-9 * tau) & (at.real < tau)])
        way = monotonic_sign(row, tau)
        met.add((way, len(turns) > 0))
        if way != 0.0:
            assert len(turns) == 0
            assert (slope(np.linspace(0.0, tau, 9)) * way > 0.0).all()
        tops = [value(row, x) for x in turns if slope.deriv()(x) < 0.0]
        highest = largest_local_maximum(row, [*slope.coef.tolist(), 0.0], tau, WORK)
        np.testing.assert_allclose(highest, max(tops, default=-math.inf), rtol=1e-12, atol=1e-14)
    assert met == {(1.0, False), (-1.0, False), (0.0, False), (0.0, True)}
