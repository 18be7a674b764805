"""The finding about collapse: proofs beside an eigenvalue problem, counts beside arithmetic in 1200 digits."""

import math
from decimal import Decimal, localcontext
from itertools import pairwise

import numpy as np
import pytest

import granular as gr
from tests.helpers.findings import script

SOAK = pytest.mark.soak
collapse = script("collapse")


def test_the_formula_of_collapse():
    """7 - 4√3 of three balls is published."""
    assert collapse.critical_restitution(3) == pytest.approx(7.0 - 4.0 * math.sqrt(3.0), rel=1e-13)


@pytest.mark.parametrize("n", [3, 4])
def test_three_and_four_balls_collapse_below_the_formula_and_part_above(n):
    assert {collapse.run_to_end(n, -0.001, seed)[0] for seed in range(2)} == {"collapse"}
    for beyond in (0.003, 0.03):
        assert collapse.run_to_end(n, beyond, 0) == ("quiet", exactly(n, beyond, 0))


def test_three_balls_collide_so_often():
    """To the one that depends on how they begin."""
    for beyond in (0.003, 0.01, 0.03):
        for seed in range(4):
            expected = pytest.approx(collapse.three_ball_collisions(beyond), abs=1.0)
            assert collapse.run_to_end(3, beyond, seed)[1] == expected


@pytest.mark.exact
def test_eight_balls_part_below_the_formula():
    ends = [collapse.run_to_end(8, -0.001, seed) for seed in range(4)]
    assert ends == [("quiet", count) for count in (432, 712, 489, 422)]
    assert exactly(8, -0.001, 3) == 422


WORD = (3, 2, 1, 2, 3, 2, 0, 1, 2, 1, 3, 0, 1, 2, 1, 0, 1, 2, 3, 2, 1, 2, 4, 3, 2, 3, 1, 4, 3, 2, 3, 4)


def test_six_balls_collapse_above_the_formula():
    """The run says that it is proved. Besides, rates and gaps are had that a word of 32 collisions makes smaller only,
    the gaps more so, and the run that starts from them spells it."""
    assert collapse.run_to_end(6, 0.001, 2)[0] == "collapse"
    eps = 1.001 * collapse.critical_restitution(6)
    by_rates, rate = leading(np.array([in_turn(unit, eps)[-1] for unit in np.eye(5)]).T)
    rate *= -np.sign(rate[WORD[0]])
    gaps = np.eye(5)
    for pair, rates in zip(WORD, in_turn(rate, eps)[:-1], strict=True):
        gaps -= np.outer(rates, gaps[pair]) / rates[pair]
    by_gaps, gap = leading(gaps)
    assert 0.0 < by_gaps < by_rates < 1.0
    start = gr.Scene([1.0] * 6, [0.0] * 6, np.where(np.arange(5) == WORD[-1], 0.0, abs(gap)), np.cumsum([0.0, *rate]))
    run = gr.edmd.simulate(start, gr.ConstantRestitution(eps))
    assert run.status is gr.Status.collapse
    assert tuple(run.contacts["pair"][:64].tolist()) == 2 * WORD


def in_turn(rates, eps):
    """Rates of the pairs before each collision of the word, and after the last."""
    rows = [np.array(rates)]
    for pair in WORD:
        row = rows[-1].copy()
        row[pair] *= -eps
        for beside in {pair - 1, pair + 1} & set(range(5)):
            row[beside] += 0.5 * (1.0 + eps) * rows[-1][pair]
        rows.append(row)
    return rows


def leading(matrix):
    """Largest eigenvalue and its vector, which are real."""
    values, vectors = np.linalg.eig(matrix)
    first = np.argmax(abs(values))
    assert values[first].imag == 0.0
    return values[first].real, vectors[:, first].real


def exactly(n, beyond, seed, digits=1200, most=6000):
    """Number of collisions until all balls part, in so many digits; `most` if they go on."""
    scene = collapse.random_balls(n, seed)
    with localcontext(prec=digits, Emin=-(10**9), Emax=10**9):
        velocity = [Decimal(v) for v in scene.velocity.tolist()]
        gap, rate = [Decimal(g) for g in scene.gap.tolist()], [b - a for a, b in pairwise(velocity)]
        eps = Decimal(collapse.critical_restitution(n) * (1.0 + beyond))
        for count in range(most):
            due = [(gap[c] / -rate[c], c) for c in range(n - 1) if rate[c] < 0]
            if not due:
                return count
            wait, pair = min(due)
            gap = [g + wait * r for g, r in zip(gap, rate, strict=True)]
            hit, gap[pair] = rate[pair], Decimal(0)
            rate[pair] = -eps * hit
            for beside in {pair - 1, pair + 1} & set(range(n - 1)):
                rate[beside] += (1 + eps) / 2 * hit
    return most


@SOAK
def test_six_balls_collapse_farther_above():
    assert collapse.run_to_end(6, 0.005, 1)[0] == "collapse"
    assert exactly(6, 0.005, 1) == 6000


@SOAK
def test_every_count_of_collisions_is_exact():
    """Where a run ends, in 1200 digits it ends after as many; where it collapses, in 1200 digits it goes on."""
    for n in range(3, 9):
        for beyond in (-0.01, -0.001, 0.001, 0.01, 0.03):
            for seed in range(2):
                kind, count = collapse.run_to_end(n, beyond, seed)
                if kind != "bounded":
                    assert exactly(n, beyond, seed) == (6000 if kind == "collapse" else count)


@SOAK
@pytest.mark.exact
def test_what_is_not_decided_may_end():
    """Five balls at 0.999 of the formula: so it is not where their collapse ends, either."""
    assert [exactly(5, -0.001, seed) for seed in range(4)] == [1126, 964, 769, 1526]
    assert {collapse.run_to_end(5, -0.001, seed)[0] for seed in range(4)} == {"bounded"}


@pytest.mark.exact
def test_soft_balls_part_after_some_contacts():
    ends = [collapse.run_to_end(n, beyond, seed, gr.md)
            for n in (3, 8) for beyond in (-0.01, 0.01) for seed in range(2)]
    assert ends == [("quiet", count) for count in (16, 7, 23, 7, 70, 51, 83, 46)]
