"""Collapse of any number of balls: proved where a word repeats, never claimed of what a judge sees end."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest

import granular as gr
from granular.edmd import proof
from granular.edmd.collapse import alternates

FREE, BESIDE = False, True


def threshold(n, wall):
    """tan²(π/4 (1 - 2/N)) of N free balls, tan²(π/4 (1 - 1/N)) beside a wall (Bernu & Mazighi 1990)."""
    return math.tan(0.25 * math.pi * (1.0 - (1.0 if wall else 2.0) / n)) ** 2


def cluster(n, wall=FREE, seed=0, mass=None):
    """Balls that rush together, or to a wall."""
    gap, mass = np.random.default_rng(seed).uniform(0.5, 1.5, n - 1), [1.0] * n if mass is None else mass
    if wall:
        return gr.Scene([math.inf, *mass], [0.0] * (n + 1), [1.0, *gap], [0.0, *-np.linspace(0.5, 1.5, n)])
    return gr.Scene(mass, [0.0] * n, gap, np.linspace(1.0, -1.0, n))


def mirrored(scene):
    return gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1])


def run(scene, eps, **options):
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"engine": "sorted", "log": False} | options)


def judged(scene, eps, most, digits):
    """The pairs that collide one after the other, at most so many: a bare event loop in so many digits."""
    with localcontext() as context:
        context.prec, context.Emin = digits, -(10**9)
        gap, v, e = list(map(Decimal, scene.gap.tolist())), list(map(Decimal, scene.velocity.tolist())), Decimal(eps)
        log = []
        while len(log) < most:
            closing = [(g / (a - b), c) for c, (g, a, b) in enumerate(zip(gap, v, v[1:], strict=False)) if b < a]
            if not closing:
                break
            wait, c = min(closing)
            gap = [max(g + wait * (b - a), Decimal(0)) for g, a, b in zip(gap, v, v[1:], strict=False)]
            gap[c] = Decimal(0)
            low, high = map(Decimal, scene.mass[c : c + 2].tolist())
            share = Decimal(0) if low.is_infinite() else high / (low + high)
            jump = (1 + e) * (v[c + 1] - v[c])
            v[c], v[c + 1] = v[c] + share * jump, v[c + 1] - (1 - share) * jump
            log.append(c)
    return log


@pytest.mark.rotating
@pytest.mark.parametrize(("n", "share"), [(3, 0.99), (4, 0.9), (4, 0.99), (5, 0.97), (5, 0.99), (6, 0.99), (7, 0.97)])
def test_free_balls_below_their_threshold_collapse_for_certain(n, share) -> None:
    for seed in range(2):
        scene, eps = cluster(n, seed=seed), share * threshold(n, FREE)
        end, other = run(scene, eps), run(mirrored(scene), eps)
        assert end.status is other.status is gr.Status.collapse
        assert end.stats["verdict"] == other.stats["verdict"] == "proved"
        assert end.stats["pairs"] == other.stats["pairs"] == (0, n - 2)
        assert f"the {'two' if n == 3 else n - 1} pairs collide in turn forever" in end.message


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 8])
def test_free_balls_above_their_threshold_never_collapse(n) -> None:
    for seed in range(3):
        end = run(cluster(n, seed=seed), 1.01 * threshold(n, FREE))
        assert end.status in (gr.Status.quiet, gr.Status.bounded)


@pytest.mark.rotating
@pytest.mark.parametrize("n", [4, 5, 6, 7, 8])
def test_balls_beside_a_wall_above_their_threshold_never_collapse(n) -> None:
    for seed in range(2):
        end = run(cluster(n, BESIDE, seed), 1.01 * threshold(n, BESIDE))
        assert end.status in (gr.Status.quiet, gr.Status.bounded)


def test_what_is_bounded_is_no_collapse_and_says_so() -> None:
    scene, eps = cluster(5, seed=1), 1.01 * threshold(5, FREE)
    end = run(scene, eps)
    assert end.status is gr.Status.bounded
    assert end.stats["verdict"] == "bounded"
    assert end.stats["bound"] < 1e-59
    assert end.message.startswith("possible inelastic collapse of pairs 0–1 to 3–4 at t = ")
    log = judged(scene, eps, 3000, 600)
    assert len(log) == 1996  # it is finite
    with pytest.raises(ValueError, match="`trajectory` must be a run that can be continued, got a possible inelastic"):
        gr.edmd.resume(end)


@pytest.mark.parametrize(("n", "seed", "collisions"), [(5, 0, 478), (6, 0, 283)])
def test_finite_sequences_have_the_count_of_the_judge(n, seed, collisions) -> None:
    scene, eps = cluster(n, seed=seed), 1.01 * threshold(n, FREE)
    assert run(scene, eps).stats["events"] == len(judged(scene, eps, 3000, 600)) == collisions


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("n", "wall", "share", "word"), [(4, FREE, 0.97, 8), (5, FREE, 0.97, 19), (3, BESIDE, 1.01, 238)]
)
def test_what_is_proved_goes_on_in_many_digits(n, wall, share, word) -> None:
    """Three balls beside a wall do so in words that are none of the pattern of the threshold, and above it."""
    scene, eps = cluster(n, wall, seed=1), share * threshold(n, wall)
    assert run(scene, eps).status is gr.Status.collapse
    log = judged(scene, eps, 3000, 600)
    assert len(log) == 3000
    assert log[-word:] == log[-2 * word : -word] == log[-3 * word : -2 * word]


@pytest.mark.rotating
def test_random_masses_are_proved_or_not_and_never_wrongly() -> None:
    random, kinds = np.random.default_rng(5), []
    for _ in range(12):
        n = int(random.integers(4, 6))
        scene, eps = cluster(n, mass=np.exp(random.uniform(-0.7, 0.7, n)).tolist()), random.uniform(0.1, 0.35)
        end = run(scene, eps)
        assert run(mirrored(scene), eps).status is end.status
        kinds.append(end.status.name)
        log = judged(scene, eps, 1500, 400)
        if end.status is gr.Status.collapse:
            assert len(log) == 1500
        elif end.status is gr.Status.quiet:
            assert len(log) == end.stats["events"]
    assert {"collapse", "quiet"} <= set(kinds)


@pytest.mark.rotating
def test_compiled_runs_come_to_the_same_verdict() -> None:
    pytest.importorskip("numba")
    for n, share in ((4, 0.97), (5, 0.99), (5, 1.01), (6, 0.99)):
        scene, eps = cluster(n, seed=1), share * threshold(n, FREE)
        plain, fast = run(scene, eps), run(scene, eps, engine="compiled")
        assert plain.message == fast.message
        assert plain.stats | {"engine": ""} == fast.stats | {"engine": ""}
        assert plain.gap.tobytes() == fast.gap.tobytes()


def pairs_of(mass, eps):
    """Records of pairs between free balls, with all that a proof asks of them."""
    pairs = np.zeros(len(mass) - 1, [("low", float), ("high", float), ("eps", float)])
    mass = np.asarray(mass)
    pairs["low"], pairs["high"] = mass[1:] / (mass[1:] + mass[:-1]), mass[:-1] / (mass[1:] + mass[:-1])
    pairs["eps"] = eps
    return pairs


def test_three_balls_are_proved_as_the_closed_form_says() -> None:
    """Away from its edge; a word that takes long to settle is not proved."""
    random, both = np.random.default_rng(2), []
    for _ in range(40):
        pairs = pairs_of(np.exp(random.uniform(-1, 1, 3)), random.uniform(0.01, 0.12))
        gap, rate = np.array([0.0, 1.0]), np.array([random.uniform(0.0, 1.5), -1.0])
        both.append((proof.forever(pairs, gap, rate) is not None, alternates(pairs, *rate, True)))
    assert all(closed for found, closed in both if found)
    assert sum(found for found, _ in both) >= 0.8 * sum(closed for _, closed in both) > 0


def test_all_collisions_take_the_time_that_is_left() -> None:
    pairs, gap, rate = pairs_of(np.ones(4), 0.15), np.array([0.0, 1.0, 1.0]), np.array([0.3, -1.0, -1.0])
    found = proof.forever(pairs, gap, rate)
    assert found is not None
    assert found[:2] == (0, 2)
    shares = np.array([proof.exact_decimals(pairs[name]) for name in ("low", "high", "eps")])
    group = proof.Group(proof.exact_decimals(gap), proof.exact_decimals(rate), shares, [])
    assert group.go_on(400)
    assert 0.999 * found.left < float(group.elapsed) <= found.left


def test_no_proof_is_tried_where_it_does_not_hold(monkeypatch) -> None:
    """With gravity, rules of speed, or a slow sequence that somebody outside reaches first."""
    monkeypatch.setattr(proof, "forever", lambda *_: proof.Forever(0, 1, math.inf))
    assert run(cluster(5), 0.9 * threshold(5, FREE)).status is gr.Status.bounded
    monkeypatch.setattr(proof, "forever", lambda *_: 1 / 0)
    assert gr.edmd.simulate(cluster(4), lambda v, pair: 0.1).status is gr.Status.bounded
    column = gr.Scene([math.inf, 1.0, 1.0, 1.0], [0.0] * 4, [0.5, 0.3, 0.4], [0.0] * 4, gravity=1.0)
    assert run(column, 0.5).status in (gr.Status.collapse, gr.Status.bounded)


def test_no_proof_is_given_of_gaps_that_their_word_does_not_lead_to() -> None:
    """Nothing of the leading gaps is there, and nothing is beside them: a bound of 0 times infinity."""
    scene = gr.Scene([math.inf, 2.0, 2.0, 1.0, 2.0, math.inf], [0.0] * 6, [0.0, 0.1, 0.0, 0.0, 0.0],
                     [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    assert run(scene, 0.1).status is gr.Status.bounded
