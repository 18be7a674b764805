"""Restitution with a threshold: balls that part with no velocity stick, until they are hit."""

import math

import numpy as np
import pytest

import granular as gr

INF = math.inf
THRESHOLDS = (0.2, 0.5, 1.0, 2.0)


def pile(n, rng=None):
    spread = np.ones(n) if rng is None else rng.uniform(0.3, 2.0, n)
    return gr.Scene([INF, *spread], [0.0] + [0.1] * n, [1.0] + [0.2] * (n - 1), [0.0] * (n + 1), gravity=9.81)


def rules(threshold, eps=0.5):
    """The same rule as a callable and as a table with a step."""
    table = gr.TabulatedRestitution([math.nextafter(threshold, 0.0), threshold], [0.0, eps])
    return (lambda speed, pair: eps if speed >= threshold else 0.0), table


@pytest.mark.parametrize("threshold", THRESHOLDS)
def test_piles_with_a_threshold_end_at_rest(threshold):
    for n in range(1, 11):
        runs = [gr.edmd.simulate(pile(n), rule, t_end=5.0, max_events=2_000) for rule in rules(threshold)]
        assert {run.status for run in runs} == {gr.Status.time}
        assert not runs[0].velocity[-1].any()
        assert not runs[0].gap[-1].any()
        assert runs[0].contacts.tobytes() == runs[1].contacts.tobytes()


@pytest.mark.parametrize("threshold", THRESHOLDS)
def test_small_piles_run_as_balls_that_merge_below_the_threshold(threshold):
    for n in (1, 2, 3):
        run = gr.edmd.simulate(pile(n), rules(threshold)[0], t_end=5.0)
        merged = gr.edmd.simulate(pile(n), gr.ConstantRestitution(0.5), t_end=5.0, collapse="merge",
                                  merge_below=threshold)
        assert run.contacts.tobytes() == merged.contacts.tobytes()


def sticky(seed):
    """Random balls, on a floor, in a box or free, and a rule that is 0 for weak impacts of some pairs."""
    rng = np.random.default_rng([50, seed])
    n, kind = int(rng.integers(2, 8)), ["floor", "box", "free", "forces"][seed % 4]
    walls = {"floor": (1, 0), "box": (1, 1), "free": (0, 0), "forces": (1, 0)}[kind]
    mass = [INF] * walls[0] + rng.uniform(0.2, 3.0, n).tolist() + [INF] * walls[1]
    gap = rng.choice([0.0, 1.0], len(mass) - 1, p=[0.2, 0.8]) * rng.uniform(0.01, 0.5, len(mass) - 1)
    gap[0] += 0.1
    velocity = [0.0 if math.isinf(m) else float(v) for m, v in zip(mass, rng.normal(size=len(mass)), strict=True)]
    more = {"floor": {"gravity": 9.81}, "forces": {"external_force": [0.0] + [-3.0] * n}}.get(kind, {})
    eps, below, odd = float(rng.uniform(0.1, 0.9)), float(rng.choice([0.05, 0.2, 1.0])), bool(rng.random() < 0.3)

    def rule(speed, pair):
        return eps if speed >= below or (odd and pair.index % 2) else 0.0

    return gr.Scene(mass, [0.0] * len(mass), gap, velocity, **more), rule, odd


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(48))
def test_sticking_conserves_momentum_and_never_adds_energy(seed):
    scene, rule, odd = sticky(seed)
    run = gr.edmd.simulate(scene, rule, t_end=3.0, max_events=20_000, samples=40)
    assert run.status is gr.Status.time or (odd and run.status in (gr.Status.bounded, gr.Status.collapse))
    energy = run.energy()
    assert (np.diff(energy) <= 1e-12 * np.abs(energy).max()).all()
    inner = ~(scene.is_wall[run.contacts["pair"]] | scene.is_wall[run.contacts["pair"] + 1])
    log, pair = run.contacts[inner], run.contacts["pair"][inner]
    given = scene.mass[pair] * (log["v_out"][:, 0] - log["v_in"][:, 0])
    taken = scene.mass[pair + 1] * (log["v_out"][:, 1] - log["v_in"][:, 1])
    apart = np.diff(log["v_out"]).ravel() != 0.0  # what sticks passes momentum on to all that is stuck to it
    scale = np.abs(given).max(initial=1.0)
    assert np.abs((given + taken)[apart]).max(initial=0.0) <= 1e-12 * scale
    if not scene.is_wall.any():
        assert np.abs(run.momentum()[-1] - run.momentum()[0]) <= 1e-11 * scale


def test_a_threshold_far_below_all_impacts_changes_nothing():
    compared = 0
    for seed in range(48):
        scene, _, _ = sticky(seed)
        free = gr.edmd.simulate(scene, lambda speed, pair: 0.7, t_end=0.4)
        if free.status is gr.Status.time and len(free.contacts):
            compared += 1
            below = 0.5 * float((free.contacts["v_in"][:, 0] - free.contacts["v_in"][:, 1]).min())
            run = gr.edmd.simulate(scene, lambda speed, pair, least=below: 0.7 if speed > least else 0.0, t_end=0.4)
            assert run.contacts.tobytes() == free.contacts.tobytes()
    assert compared >= 12


@pytest.mark.parametrize("n", [2, 5, 10])
def test_what_is_infinite_in_another_way_is_bounded_and_names_the_remedy(n):
    run = gr.edmd.simulate(pile(n, np.random.default_rng(n)), lambda speed, pair: 0.5, t_end=5.0)
    assert run.status is gr.Status.bounded
    assert run.message.endswith("; give collapse='merge' to continue")
    assert len(run.contacts) < 20_000


def test_a_hit_parts_balls_that_stuck():
    """Two balls stick, a third one hits them fast: the pair that stuck is free again and follows its rule."""
    scene = gr.Scene([1.0, 1.0, 1.0], [0.0] * 3, [0.01, 1.0], [0.1, 0.0, -3.0])
    run = gr.edmd.simulate(scene, lambda speed, pair: 1.0 if speed > 0.5 else 0.0)
    assert [int(c) for c in run.contacts["pair"]] == [0, 1, 0]
    assert run.velocity[-1] == pytest.approx([-3.0, 0.05, 0.05])


@pytest.mark.rotating
@pytest.mark.parametrize("part", range(4))
def test_a_run_with_sticking_balls_resumes_bit_for_bit(part):
    resumed = 0
    for seed in range(part, 48, 4):
        scene, rule, _ = sticky(seed)
        cut = float(np.random.default_rng([52, seed]).uniform(0.1, 2.5))
        first = gr.edmd.simulate(scene, rule, t_end=cut, max_events=20_000)
        if first.status is gr.Status.time:
            resumed += 1
            whole = gr.edmd.simulate(scene, rule, t_end=3.0, max_events=20_000)
            rest = gr.edmd.resume(first, t_end=3.0, max_events=20_000)
            assert np.concatenate([first.contacts, rest.contacts]).tobytes() == whole.contacts.tobytes()
            assert rest.velocity[-1].tobytes() == whole.velocity[-1].tobytes()
    assert resumed >= 8


def has_mirror_image(seed):
    """Whether the scene has no gravity, and the rule treats all pairs alike."""
    scene, _, odd = sticky(seed)
    return not (scene.gravity or odd)


@pytest.mark.parametrize("seed", [seed for seed in range(48) if has_mirror_image(seed)])
def test_mirror_images_of_balls_that_stick(seed):
    """The lowest pair acts first in one scene, the highest pair in its mirror image."""
    scene, rule, _ = sticky(seed)
    force = None if scene.external_force is None else -scene.external_force[::-1]
    image = gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1], external_force=force)
    one = gr.edmd.simulate(scene, rule, t_end=3.0, ties="left", max_events=20_000)
    other = gr.edmd.simulate(image, rule, t_end=3.0, ties="right", max_events=20_000)
    assert (one.status, len(one.contacts)) == (other.status, len(other.contacts))
    fastest = float((one.contacts["v_in"][:, 0] - one.contacts["v_in"][:, 1]).max(initial=0.0))
    assert np.abs(one.velocity[-1] + other.velocity[-1][::-1]).max() <= 1e-9 * fastest
