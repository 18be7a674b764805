"""Laws are asked in one place what they are, once for every kind of pair; pairs are made when they are asked for."""

import ast
import math
import pickle
import tracemalloc
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.laws import resolve
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import number_distinct_rows, resolved
from granular.scene import Pair, Scene, positions, velocities

TRAITS = {"linear", "power", "memory", "potential", "exponent", "rate_dependent"}


@dataclass(frozen=True)
class Numbered:
    """A law that is another one in every pair."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * (1.0 + pair.index) * xi


@dataclass(frozen=True)
class Steep(Numbered):
    """The same without a form."""

    def force(self, xi, xi_dot, pair):
        return self.k * (1.0 + pair.index) * xi * xi + self.k * pair.m_eff * xi


class Changing:
    """A law that is no frozen dataclass: equal ones may come to differ."""

    def __init__(self, k):
        self.k = k

    def force(self, xi, xi_dot, pair):
        return self.k * xi * math.sqrt(xi)


def some_laws(random, n):
    """Few laws for many pairs: the same objects, equal ones, and some that look at their pair."""
    made = [
        lambda: gr.LinearDashpot(1e6, 3.0), lambda: gr.Hertz(1e9), lambda: gr.TsujiHertz(1e9, 0.3),
        lambda: gr.WaltonBraun(1e5, 3e5), lambda: Numbered(1e5), lambda: Steep(1e7), lambda: Changing(1e8),
    ]
    few = [make() for make in made]
    return [few[i] if random.random() < 0.5 else made[i]() for i in random.integers(len(made), size=n)]


def some_scene(random, n):
    mass, radius = random.choice([1.0, 2.0], n), random.choice([0.0, 0.1, 0.2], n)
    mass[0], radius[0] = (math.inf, 0.0) if random.random() < 0.5 else (1.0, 0.1)
    return Scene(mass, radius, random.choice([0.0, 0.1], n - 1), random.normal(size=n), 9.81)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(20))
def test_laws_by_kinds_of_pairs_are_the_laws_of_the_pairs(seed):
    random = np.random.default_rng(seed)
    scene = some_scene(random, int(random.integers(2, 60)))
    laws = some_laws(random, scene.n_pairs)
    known = resolved(laws, scene)
    assert known.given == tuple(laws)
    assert len(known) == scene.n_pairs
    for one, law, pair in zip(known, laws, scene.pairs, strict=True):
        alone = resolve(law, pair)
        assert one.law == law or one.law is law
        assert one.pair == pair
        assert all(getattr(one, f.name) == getattr(alone, f.name) for f in fields(PairLaw)[2:6])
        assert one.force(1e-3, 0.2, 2e-3) == alone.force(1e-3, 0.2, 2e-3)
    depths = known.column(lambda law: law.overlap_at(1.0))
    assert depths.tolist() == [resolve(law, pair).overlap_at(1.0) for law, pair in zip(laws, scene.pairs, strict=True)]


@pytest.mark.parametrize("seed", range(20))
def test_rows_alike_are_numbered_in_the_order_in_which_they_come(seed):
    random = np.random.default_rng(seed)
    columns = random.integers(int(random.integers(1, 4)), size=(3, int(random.integers(1, 50)))).astype(float)
    kind, first = number_distinct_rows(*columns)
    rows = [tuple(row) for row in columns.T]
    different = list(dict.fromkeys(rows))
    assert kind.tolist() == [different.index(row) for row in rows]
    assert first.tolist() == [rows.index(row) for row in different]


def test_a_law_is_asked_no_more_often_in_a_larger_gas_of_equal_balls():
    calls = []

    @dataclass(frozen=True)
    class Counting:
        k: float

        def force(self, xi, xi_dot, pair):
            calls.append(pair)
            return self.k * xi

    asked = []
    for n in (20, 2000):
        scene = Scene(np.ones(n), np.full(n, 0.1), np.full(n - 1, 0.1), np.zeros(n))
        calls.clear()
        gr.md.simulate(scene, Counting(1e6), t_end=0.0)
        asked.append(len(calls))
    assert asked[1] == asked[0] < 100


@dataclass(frozen=True)
class Heavy:
    """A law that says it is k ξ, and is so in one pair only."""

    k: float

    def linear(self, pair):
        return self.k, 0.0

    def force(self, xi, xi_dot, pair):
        return self.k * xi * pair.m_eff


def test_laws_that_do_not_look_at_their_pair_are_one_kind_among_unequal_balls():
    random = np.random.default_rng(4)
    n = 1000
    scene = Scene(random.uniform(0.5, 2.0, n), random.uniform(0.1, 0.2, n), np.full(n - 1, 0.1), np.zeros(n))
    for law, kinds in ((gr.LinearDashpot(1e6, 3.0), 1), (gr.Hertz(1e9), 1), (gr.TsujiHertz(1e9, 0.3), n - 1)):
        known = resolved((law,) * (n - 1), scene)
        assert len(known.each) == kinds
        assert len(known.in_pairs[1]) == n - 1
        assert known.column(lambda one: one.pair.m_eff).tolist() == scene.pairs.m_eff.tolist()
    light = Scene([2.0, 2.0, 3.0], [0.1] * 3, [0.1, 0.1], [0.0] * 3)
    with pytest.raises(ValueError, match="law of pair 1–2"):
        gr.md.simulate(light, Heavy(1e6), t_end=0.0)


class Plain:
    """No slots."""


@dataclass(frozen=True, slots=True)
class Slotted(Plain):
    """k ξ, held in a slot."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi


@dataclass(frozen=True)
class Branching:
    """A law whose stiffness hangs on the number of a pair where the pair is small."""

    k: float

    def linear(self, pair):
        return (self.k if pair.r_eff > 0.07 else self.k * (1 + pair.index)), 0.0

    def force(self, xi, xi_dot, pair):
        return self.linear(pair)[0] * xi


@dataclass(frozen=True)
class Chosen:
    """Another stiffness in one pair, found by comparison."""

    k: float
    pair: Pair

    def force(self, xi, xi_dot, pair):
        return (5.0 if pair == self.pair else 1.0) * self.k * xi


@dataclass(frozen=True)
class First:
    """Twice as stiff in every pair but the first, by the truth of its number."""

    k: float

    def force(self, xi, xi_dot, pair):
        return (2.0 if pair.index else 1.0) * self.k * xi


@dataclass(frozen=True)
class LookedUp:
    """Another stiffness in one pair, from a table."""

    k: float

    def force(self, xi, xi_dot, pair):
        return {3: 5.0}.get(pair.index, 1.0) * self.k * xi


def test_whatever_a_law_asks_of_its_pair_it_is_the_law_of_that_pair():
    scene = Scene([math.inf, *[1.0] * 5], [0.0, *[0.1] * 5], [0.0] * 5, [0.0] * 5 + [-1.0])
    for laws, stiffness in (
        ([Slotted(k * 1e6) for k in range(1, 6)], [1e6, 2e6, 3e6, 4e6, 5e6]),
        ([Branching(1e6)] * 5, [1e6, 2e6, 3e6, 4e6, 5e6]),
        ([Chosen(1e6, scene.pairs[3])] * 5, [1e6, 1e6, 1e6, 5e6, 1e6]),
        ([LookedUp(1e6)] * 5, [1e6, 1e6, 1e6, 5e6, 1e6]),
    ):
        assert resolved(laws, scene).column(lambda law: law.form[0]).tolist() == stiffness
        one, other = (
            gr.md.simulate(scene, given, t_end=0.01) for given in (laws, [gr.LinearDashpot(k) for k in stiffness])
        )
        np.testing.assert_allclose(one.velocity, other.velocity, atol=1e-13)


def test_the_truth_of_a_number_is_asked_for_as_well():
    scene = Scene(np.ones(4), np.full(4, 0.1), np.zeros(3), np.zeros(4))
    assert resolved([First(1e6)] * 3, scene).column(lambda law: law.form[0]).tolist() == [1e6, 2e6, 2e6]


def test_a_law_that_looks_at_the_number_of_its_pair_is_another_one_in_each():
    scene = Scene(np.ones(4), np.full(4, 0.1), np.full(3, 0.1), np.zeros(4))
    law = Numbered(1e5)
    assert measures.groups(scene, (law,) * 3, 1.0)["stiffness_ratio"] == pytest.approx(3.0)
    scene = Scene(np.ones(4), np.full(4, 0.1), np.zeros(3), [1.0, 0.0, 0.0, 0.0])
    stiff = [gr.LinearDashpot(1e5 * (1 + c)) for c in range(3)]
    one, other = (gr.md.simulate(scene, laws, t_end=0.1) for laws in (law, stiff))
    np.testing.assert_array_equal(one.velocity, other.velocity)
    assert one.contacts.tobytes() == other.contacts.tobytes()
    np.testing.assert_array_equal(one.energy(), other.energy())


def test_nobody_but_the_laws_asks_a_law_what_it_is():
    root, found = Path(gr.__file__).parent, []
    for path in root.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())) if path.parent.name != "laws" else ():
            asks = isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("getattr", "hasattr")
            if asks and isinstance(node.args[1], ast.Constant) and node.args[1].value in TRAITS:
                found.append(f"{path.relative_to(root)}:{node.lineno}")
    assert found == []


def test_pairs_are_a_sequence_as_a_tuple_is():
    scene = some_scene(np.random.default_rng(1), 6)
    pairs, whole = scene.pairs, tuple(scene.pairs)
    assert all(type(pair) is Pair and pair.index == c for c, pair in enumerate(whole))
    assert pairs == whole
    assert pairs == scene.replace(gravity=1.0).pairs
    assert pairs != whole[1:]
    assert hash(pairs) == hash(whole)
    assert len(pairs) == len(whole) == scene.n_pairs
    assert (pairs[0], pairs[-1], pairs[np.int64(2)]) == (whole[0], whole[-1], whole[2])
    assert (pairs[1:], pairs[::-2], list(reversed(pairs))) == (whole[1:], whole[::-2], list(whole[::-1]))
    assert whole[3] in pairs
    assert pairs.index(whole[3]) == 3
    assert pickle.loads(pickle.dumps(pairs)) == pairs
    for wrong in (5, -6):
        with pytest.raises(IndexError):
            pairs[wrong]


def test_a_pair_whose_effective_mass_is_no_number_is_refused():
    with pytest.raises(ValueError, match=r"`m_eff` must be a finite number above 0, got 0\.0"):
        assert Scene([1.0, 5e-324, 5e-324], [0.1] * 3, [0.1] * 2, [0.0] * 3).pairs


@pytest.mark.parametrize("seed", range(10))
def test_positions_and_velocities_follow_from_gaps_and_the_anchor(seed):
    random = np.random.default_rng(seed)
    scene = some_scene(random, int(random.integers(2, 9)))
    elapsed = np.array([0.0, 0.3, 2.0])
    gap = scene.gap + random.uniform(size=(3, scene.n_pairs))
    rate = random.normal(size=(3, scene.n_pairs))
    x, v = positions(scene, gap, elapsed), velocities(scene, rate, elapsed)
    lower, upper = scene.sides(scene.radius)
    np.testing.assert_allclose(scene.across(x), lower + gap + upper, rtol=1e-13)
    np.testing.assert_allclose(scene.across(v), rate, rtol=1e-11, atol=1e-12)
    share = scene.is_wall / 1.0 if scene.is_wall.any() else scene.mass / scene.mass.sum()
    falls = 0.0 if scene.is_wall.any() else scene.gravity
    with_time = share @ scene.velocity * elapsed - 0.5 * falls * elapsed**2
    np.testing.assert_allclose(x @ share, share @ scene.position + with_time, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(scene.anchor(elapsed), x @ share, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(v @ share, share @ scene.velocity - falls * elapsed, rtol=1e-12, atol=1e-12)


def test_a_large_hard_gas_keeps_few_bytes_a_ball():
    n = 20_000
    random = np.random.default_rng(0)
    scene = Scene(np.ones(n), np.full(n, 0.01), random.uniform(0.005, 0.015, n - 1), random.normal(size=n))
    gr.edmd.simulate(gr.scenes.gas(10), gr.ConstantRestitution(0.9), max_events=0, log=False)
    tracemalloc.start()
    try:
        run = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), max_events=0, log=False)
        kept = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert run.status is gr.Status.max_events
    assert kept <= 250.0 * n
