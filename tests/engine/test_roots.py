"""The certified first root against exact rational root isolation, against dense sampling and against itself."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from fractions import Fraction
from itertools import pairwise
from typing import TypeAlias

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from granular._engine.kernels import compiled, have_numba
from granular._engine.roots import NO_ROOT, first_up_crossing, workspace

DEGREE = 20
WORK = workspace(DEGREE + 4)


# --- the slow, obviously right twin -------------------------------------------------------------------------------


def exact_first_up(p: list[Fraction], theta: Fraction) -> Fraction | None:
    """First up-crossing in exact arithmetic, to 2^-70 of itself; None if there is none."""
    while p and p[0] == 0:
        p = p[1:]
    if not p:
        return None
    if p[0] > 0:
        return Fraction(0)
    todo = [(Fraction(0), Fraction(1), bernstein([c * theta**j for j, c in enumerate(p)]))]
    while todo:
        left, width, b = todo.pop()
        if max(b) <= 0:
            continue
        signs = [c > 0 for c in b if c != 0]
        changes = sum(x != y for x, y in pairwise(signs))
        if changes == 0:
            return theta * left
        if changes == 1 and b[-1] > 0 and width <= left / 2**70:
            return theta * left
        if width < Fraction(1, 2**400):
            raise ArithmeticError("an exact double root has no sign")
        first, second = halves(b)
        todo += [(left + width / 2, width / 2, second), (left, width / 2, first)]
    return None


def bernstein(s: list[Fraction]) -> list[int]:
    """Bernstein coefficients on [0, 1], times a common positive factor."""
    n = len(s) - 1
    b = [sum(math.comb(i, j) * s[j] / math.comb(n, j) for j in range(i + 1)) for i in range(n + 1)]
    common = math.lcm(*(Fraction(c).denominator for c in b))
    return [int(c * common) for c in b]


def halves(b: list[int]) -> tuple[list[int], list[int]]:
    """Split at the middle (de Casteljau), times 2^n."""
    left, right = [], []
    n = len(b) - 1
    for k in range(n + 1):
        left.append(b[0] << (n - k))
        right.append(b[-1] << (n - k))
        b = [x + y for x, y in pairwise(b)]
    return left, right[::-1]


# --- kinds of polynomials -----------------------------------------------------------------------------------------


def taylor(rng: np.random.Generator) -> list[float]:
    """Decaying like the Taylor coefficients of a step."""
    p = rng.standard_normal(DEGREE + 1) * rng.uniform(0.3, 1.0) ** np.arange(DEGREE + 1)
    p[0] = -abs(p[0]) * 10.0 ** rng.uniform(-8, 0)
    return list(map(float, p))


def zero_at_front(rng: np.random.Generator) -> list[float]:
    """Just left a root: p_0 = 0 exactly, and here and there p_1 = 0 too."""
    p = taylor(rng)
    return [0.0, *p[:-1]] if rng.random() < 0.7 else [0.0, 0.0, *p[:-2]]


def twin_roots(rng: np.random.Generator) -> list[float]:
    """Up at a, down again 1e-12 ... 0.1 later."""
    a, d = rng.uniform(0.05, 0.85), 10.0 ** rng.uniform(-12, -1)
    return times([-a * (a + d), 2 * a + d, -1.0], positive(rng))


def near_miss(rng: np.random.Generator) -> list[float]:
    """A complex pair 1e-12 ... 0.1 off the real axis: almost an event."""
    a, d = rng.uniform(0.05, 0.85), 10.0 ** rng.uniform(-12, -1)
    return times([-a * a - d * d, 2 * a, -1.0], positive(rng))


def near_left_end(rng: np.random.Generator) -> list[float]:
    return times([-1e-14 * rng.uniform(0.5, 2.0), 1.0], positive(rng))


def near_right_end(rng: np.random.Generator) -> list[float]:
    return times([-1.0 + 1e-14 * rng.uniform(0.5, 2.0), 1.0], positive(rng))


def positive(rng: np.random.Generator) -> list[float]:
    """A polynomial of degree DEGREE - 2 without roots in [0, 1]."""
    q = rng.standard_normal(DEGREE - 1) * 0.5 ** np.arange(DEGREE - 1)
    q[0] = np.abs(q[1:]).sum() + rng.uniform(0.01, 1.0)
    return list(map(float, q))


def times(p: list[float], q: list[float]) -> list[float]:
    return list(map(float, np.convolve(p, q)))


Kind: TypeAlias = Callable[[np.random.Generator], list[float]]
SHARP: list[Kind] = [near_left_end, near_right_end]
KINDS: list[Kind] = [taylor, zero_at_front, twin_roots, near_miss, *SHARP]


def noise_of(p: list[float], theta: float) -> float:
    return 4 * len(p) * 2.0**-53 * max(abs(c) * theta**j for j, c in enumerate(p))


def sample(kind: Kind, n: int) -> Iterator[tuple[list[float], float]]:
    rng = np.random.default_rng(KINDS.index(kind))
    for _ in range(n):
        yield kind(rng), 1.0 if kind in SHARP or rng.random() < 0.5 else float(rng.uniform(0.1, 1.2))


def assert_certified(p: list[float], theta: float, t: float) -> None:
    """The answer lies between the exact first up-crossings of p + noise and p - noise.

    So nothing above noise was missed before it, and p is within noise of rising through zero there.
    """
    exact, length = [Fraction(c) for c in p], Fraction(theta)
    while exact and exact[0] == 0:
        del exact[0]
    if not exact:
        assert t == NO_ROOT
        return
    noise = 2 * Fraction(noise_of(p, theta))
    if exact[0] > 0:
        assert t == 0.0
        return
    latest = exact_first_up([exact[0] - noise, *exact[1:]], length)
    earliest = exact_first_up([exact[0] + noise, *exact[1:]], length)
    if t == NO_ROOT:
        assert latest is None
    else:
        assert 0.0 <= t <= theta
        assert earliest is not None
        assert earliest <= Fraction(t) * (1 + Fraction(1, 2**51))
        assert latest is None or Fraction(t) * (1 - Fraction(1, 2**51)) <= latest


# --- the tests ----------------------------------------------------------------------------------------------------


@pytest.mark.rotating
@pytest.mark.parametrize("kind", KINDS)
def test_between_the_exact_roots_of_p_plus_and_minus_noise(kind: Kind) -> None:
    for p, theta in sample(kind, 50):
        assert_certified(p, theta, first_up_crossing(p, theta, WORK))


@pytest.mark.parametrize("kind", SHARP)
def test_roots_at_the_ends_are_right_to_rounding(kind: Kind) -> None:
    for p, theta in sample(kind, 50):
        t = first_up_crossing(p, theta, WORK)
        exact = exact_first_up([Fraction(c) for c in p], Fraction(theta))
        if t == NO_ROOT:  # what is left of p after a root next to the right end may drown in its noise
            assert kind is near_right_end
            assert sum(p) <= noise_of(p, theta)
        else:
            assert exact is not None
            assert t == pytest.approx(float(exact), rel=4e-16, abs=0.0)


def test_simple_roots_are_right_to_their_condition() -> None:
    for p, theta in sample(taylor, 100):
        t = first_up_crossing(p, theta, WORK)
        exact = exact_first_up([Fraction(c) for c in p], Fraction(theta))
        slope = sum(j * c * t ** (j - 1) for j, c in enumerate(p) if j) if t != NO_ROOT else 0.0
        if exact is not None and slope > 1e-3:
            size = sum(abs(c) * t**j for j, c in enumerate(p))
            assert abs(t - float(exact)) <= 4 * 2.0**-52 * (t + size / slope)


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_a_dense_sampling_sees_is_missed(kind: Kind) -> None:
    grid = np.linspace(0.0, 1.0, 1001)[1:]
    for p, theta in sample(kind, 300):
        above = np.polynomial.polynomial.polyval(grid * theta, p) > 2 * noise_of(p, theta)
        seen = float(grid[above.argmax()]) * theta if above.any() else NO_ROOT
        assert first_up_crossing(p, theta, WORK) <= seen


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
def test_compiled_gives_the_same_bits() -> None:
    fast, work = compiled(first_up_crossing), np.array(WORK)
    for kind in KINDS:
        for p, theta in sample(kind, 500):
            plain = first_up_crossing(p, theta, WORK)
            assert np.float64(fast(np.array(p), theta, work, 1.0)).tobytes() == np.float64(plain).tobytes()


@pytest.mark.parametrize(
    ("p", "theta", "root"),
    [
        ([-1.0, 2.0], 1.0, 0.5),
        ([-1.0, 2.0], 0.4, NO_ROOT),
        ([1.0, -1.0], 1.0, 0.0),  # already above
        ([0.0, 1.0], 1.0, 0.0),  # rising from an exact zero
        ([0.0, -1.0, 4.0], 1.0, 0.25),  # a root just left is not found again, the next one is
        ([0.0, 0.0, 0.0], 1.0, NO_ROOT),
        ([0.0], 1.0, NO_ROOT),
        ([-0.0, -1.0], 1.0, NO_ROOT),
        ([-1.0, 2.0], 0.0, NO_ROOT),
        ([-0.25, 1.0, -1.0], 1.0, NO_ROOT),  # touches zero from below
        ([-0.25 * (1 - 2.0**-53), 1.0, -1.0], 1.0, NO_ROOT),  # a hump of 3e-17: nobody can tell
        ([0.125, -0.75, 1.0], 1.0, 0.0),
        ([-0.125, 0.75, -1.0], 1.0, 0.25),  # up at 1/4, down at 1/2
        ([-1.0, 0.0, 0.0, 8.0], 1.0, 0.5),
    ],
)
def test_small_cases(p: list[float], theta: float, root: float) -> None:
    assert first_up_crossing(p, theta, WORK) == root


coefficients = st.floats(-1e3, 1e3).map(lambda c: c if abs(c) > 1e-30 else 0.0)
polynomials = st.lists(coefficients, min_size=1, max_size=12)


@settings(max_examples=200, deadline=None)
@given(polynomials, st.floats(1e-3, 4.0))
def test_any_polynomial_is_certified(p: list[float], theta: float) -> None:
    assert_certified(p, theta, first_up_crossing(p, theta, WORK))


@settings(deadline=None)
@given(polynomials, st.floats(1e-3, 4.0), st.integers(-20, 20), st.integers(-20, 20))
def test_units_in_powers_of_two_and_sign_change_no_bit(p: list[float], theta: float, a: int, b: int) -> None:
    t = first_up_crossing(p, theta, WORK)
    scaled = [math.ldexp(c, a - j * b) for j, c in enumerate(p)]
    assert first_up_crossing(scaled, math.ldexp(theta, b), WORK) == math.ldexp(t, b)
    assert first_up_crossing([-c for c in p], theta, WORK, -1.0) == t
