"""Random soft scenes, all laws and options at once: what must hold whatever the law, with no other solver at hand."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import pytest
from fuzz.laws import DampedPower, Stiffening

import granular as gr
from granular.scene import Pair, Scene
from granular.trajectory import Status, Trajectory

SEEDS = range(24)
SPAN = 1.0


@dataclass(frozen=True)
class Softening:
    """F = k ξ / (1 + ξ/x), without any trait."""

    k: float
    x: float

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return self.k * xi / (1.0 + xi / self.x)


def law(rng: Any, pair: Pair, own: bool) -> Any:
    """A law of any kind, laws that are no powers only where `own`."""
    k = 10.0 ** float(rng.uniform(2.0, 6.0))
    zeta = float(rng.choice([0.0, 0.05, 0.3, 1.0]))
    c = 2.0 * zeta * math.sqrt(k * pair.m_eff)
    kinds: list[Callable[[], Any]] = [
        lambda: gr.LinearDashpot(k, c),
        lambda: gr.Hertz(k),
        lambda: gr.ViscoelasticHertz(k, c),
        lambda: gr.TsujiHertz(k, zeta),
        lambda: gr.PowerLaw(k, float(rng.choice([1.25, 4.0 / 3.0, 2.0, 3.0]))),
        lambda: DampedPower(k, float(rng.choice([1.5, 2.0, 2.5])), c, float(rng.choice([0.5, 1.0]))),
        lambda: gr.WaltonBraun(k, 2.0 * k),
        lambda: gr.PowerLaw(k, float(rng.uniform(1.05, 3.0))),
        lambda: Stiffening(k, 1e3 * k, c),
        lambda: Softening(k, 0.01),
    ]
    return kinds[int(rng.integers(len(kinds) if own else 6))]()


def start(rng: Any) -> Scene:
    """Two to four balls, perhaps between walls, on a floor under gravity, touching at rest, or overlapping."""
    n = int(rng.integers(2, 5))
    floor, ceiling = int(rng.random() < 0.4), int(rng.random() < 0.2)
    gap = rng.choice([0.0, 1e-6, 0.01, 0.1, -1e-3], n - 1 + floor + ceiling)
    velocity = np.round(rng.uniform(-1.0, 1.0, n), 3)
    if rng.random() < 0.3:
        velocity[1:], gap = 0.0, np.where(gap < 0.0, 0.0, gap)
    mass = [math.inf] * floor + (10.0 ** rng.uniform(-1.0, 1.0, n)).tolist() + [math.inf] * ceiling
    radius = [0.0] * floor + [0.5] * n + [0.0] * ceiling
    gravity = 9.81 if floor and rng.random() < 0.4 else 0.0
    return Scene(mass, radius, gap, [0.0] * floor + velocity.tolist() + [0.0] * ceiling, gravity)


@cache
def drawn(seed: int) -> tuple[Scene, tuple[Any, ...], Trajectory]:
    """Scene, laws and run of a seed, to `SPAN`, or as far as seven contacts or 120 steps reach."""
    rng = np.random.default_rng([2011, seed])
    scene = start(rng)
    own = seed % 4 == 3
    laws = tuple(law(rng, pair, own) for pair in scene.pairs)
    if rng.random() < 0.4:
        laws = (law(rng, scene.pairs[0], own),) * len(laws)
    first = gr.md.simulate(scene, laws, t_end=SPAN, max_events=7, max_steps=120, engine="plain")
    end = SPAN if first.status is Status.time else 0.999 * float(first.time[-1])
    run = first if first.status is Status.time else gr.md.simulate(scene, laws, t_end=end, engine="plain")
    assert run.status is Status.time
    assert run.time[-1] == end
    return scene, laws, run


def again(seed: int, **options: Any) -> Trajectory:
    """The run of a seed with other options."""
    scene, laws, run = drawn(seed)
    chosen: dict[str, Any] = {"t_end": float(run.time[-1]), "engine": "plain"} | options
    return gr.md.simulate(scene, laws, **chosen)


def same_log(one: Trajectory, other: Trajectory) -> bool:
    return one.contacts.tobytes() == other.contacts.tobytes()


def speed(scene: Scene, run: Trajectory) -> float:
    return float(max(abs(scene.velocity).max(), abs(run.velocity[-1]).max(), 1e-3))


def close(one: Trajectory, velocity: Any, run: Trajectory) -> bool:
    """Whether a run ends with given velocities; resting contacts and near misses may magnify what is rounding."""
    return bool(abs(one.velocity[-1] - velocity).max() <= 1e-8 * speed(run.scene, run))


@pytest.mark.parametrize("seed", SEEDS)
def test_options_change_no_bit_of_the_log(seed: int) -> None:
    """Samples, also at events, are kept and change nothing; nor do `on_event`, `on_progress`, `log`."""
    _, _, run = drawn(seed)
    end = float(run.time[-1])
    times = np.unique(np.concatenate([np.linspace(0.0, end, 5), run.contacts["t_begin"]]))
    told: list[Any] = []
    looked = again(seed, samples=times, on_event=told.append, on_progress=lambda t, n: None)
    assert same_log(run, looked)
    assert looked.time.tobytes() == times.tobytes()
    assert abs(looked.velocity[-1] - run.velocity[-1]).max() <= 1e-14 * speed(run.scene, run)
    assert len(told) == np.count_nonzero(~np.isnan(run.contacts["t_end"]))
    quiet = again(seed, log=False)
    assert abs(quiet.velocity[-1] - run.velocity[-1]).max() <= 1e-14 * speed(run.scene, run)
    assert quiet.stats["contacts"] == run.stats["contacts"] == len(run.contacts)


@pytest.mark.parametrize("seed", SEEDS)
def test_until_stops_where_the_free_run_begins_a_contact(seed: int) -> None:
    """`until.contact(c, n)` ends at the t_begin of the nth row of pair c; what has ended before is the same."""
    _, _, run = drawn(seed)
    if not len(run.contacts):
        return
    row = run.contacts[seed % len(run.contacts)]
    pair = int(row["pair"])
    nth = int(np.count_nonzero(run.of(pair)["t_begin"] <= row["t_begin"]))
    stopped = again(seed, until=gr.until.contact(pair, nth))
    assert stopped.status is Status.until
    assert stopped.time[-1] == row["t_begin"]
    assert stopped.count(pair) == nth - 1
    over = stopped.contacts[~np.isnan(stopped.contacts["t_end"])]
    seen = np.isin(run.contacts["t_begin"], over["t_begin"]) & (run.contacts["t_end"] <= stopped.time[-1])
    assert over.tobytes() == run.contacts[seen].tobytes()


@pytest.mark.parametrize("seed", SEEDS)
def test_compiled_gives_the_bits_of_plain(seed: int) -> None:
    """The same state, log and estimate, where the laws can be compiled; a sentence where not."""
    _, _, run = drawn(seed)
    try:
        fast = again(seed, engine="compiled")
    except TypeError as error:
        assert "compiled" in str(error)  # noqa: PT017
        fast = again(seed, engine="auto")
    assert same_log(run, fast)
    assert (fast.velocity.tobytes(), fast.gap.tobytes()) == (run.velocity.tobytes(), run.gap.tobytes())
    assert fast.stats["error_estimate"] == run.stats["error_estimate"]


@pytest.mark.parametrize("seed", SEEDS)
def test_impulses_of_the_log_make_the_velocities(seed: int) -> None:
    """m_i (v_i - v_i0 + g t) = J_(i-1) - J_i, ball by ball; and contacts of a pair follow each other."""
    scene, _, run = drawn(seed)
    impulse = np.zeros(scene.n + 1)
    np.add.at(impulse, run.contacts["pair"] + 1, run.contacts["impulse"])
    balls = ~scene.is_wall
    change = run.velocity[-1] - scene.velocity + scene.gravity * float(run.time[-1])
    below, above = impulse[:-1][balls], impulse[1:][balls]
    miss = scene.mass[balls] * change[balls] - (below - above)
    assert np.all(abs(miss) <= 1e-11 * (scene.mass[balls] * speed(scene, run) + below + above))
    for pair in range(scene.n - 1):
        rows = run.of(pair)
        assert np.all(rows["t_end"][:-1] <= rows["t_begin"][1:])


@pytest.mark.parametrize("seed", SEEDS)
def test_mirror_and_boost(seed: int) -> None:
    """The mirror image, and the view from a moving train, show the same contacts."""
    scene, laws, run = drawn(seed)
    if scene.gravity:
        return
    end = float(run.time[-1])
    image = Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1])
    mirrored = gr.md.simulate(image, laws[::-1], t_end=end, engine="plain")
    assert len(mirrored.contacts) == len(run.contacts)
    assert close(mirrored, -run.velocity[-1][::-1], run)
    passing = gr.md.simulate(scene.replace(velocity=scene.velocity + 2.0), laws, t_end=end, engine="plain")
    assert len(passing.contacts) == len(run.contacts)
    assert close(passing, run.velocity[-1] + 2.0, run)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_run_in_two_parts_is_one_run(seed: int) -> None:
    """Stopped anywhere, and gone on with from gaps and velocities: the same end, except for laws with memory."""
    scene, laws, run = drawn(seed)
    if any(getattr(one, "memory", False) for one in laws):
        return
    end = float(run.time[-1])
    half = again(seed, t_end=0.43 * end)
    rest = scene.replace(gap=half.gap[-1], velocity=half.velocity[-1], origin=float(half.position[-1][0]))
    assert close(gr.md.simulate(rest, laws, t_end=end - 0.43 * end, engine="plain"), run.velocity[-1], run)
