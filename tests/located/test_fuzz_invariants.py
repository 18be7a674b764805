"""Random soft scenes, all laws and options at once: what must hold whatever the law, with no other solver at hand."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

import granular as gr
from granular import Scene, Status, Trajectory
from tests.helpers import scenes_at_random as builder

SEEDS = range(24)
SPAN = 1.0


COMPILES = (gr.LinearDashpot, gr.Hertz, gr.ViscoelasticHertz, gr.TsujiHertz, gr.PowerLaw)
OWN = ("Walton-Braun", "power", "stiffening", "softening", "own Hertz", "own with memory")


@cache
def drawn(seed: int) -> tuple[Scene, tuple[Any, ...], Trajectory]:
    """Scene, laws and run of a seed, to `SPAN`, or as far as seven contacts or 120 steps reach."""
    rng = np.random.default_rng([2011, seed])
    scene = builder.scene(rng, (2, 4), walls=(0.4, 0.2, 0.0), gaps=builder.ALL)
    laws = builder.laws(rng, scene, OWN if seed % 4 == 3 else builder.POWERS)
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


@pytest.mark.rotating
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


@pytest.mark.rotating
@pytest.mark.parametrize("seed", SEEDS)
def test_until_stops_where_the_free_run_begins_a_contact(seed: int) -> None:
    """`until.contact(c, n)` ends at the t_begin of the nth row of pair c; what has ended before is the same."""
    _, _, run = drawn(seed)
    if not len(run.contacts):
        pytest.skip("no contact")
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


@pytest.mark.rotating
@pytest.mark.parametrize("seed", SEEDS)
def test_compiled_gives_the_bits_of_plain(seed: int) -> None:
    """The same state, log and estimate, where the laws can be compiled; a sentence where not."""
    _, laws, run = drawn(seed)
    if all(isinstance(law, COMPILES) for law in laws):
        fast = again(seed, engine="compiled")
        assert fast.stats["engine"] == "compiled"
    else:
        with pytest.raises(TypeError, match="compiled"):
            again(seed, engine="compiled")
        fast = again(seed, engine="auto")
    assert same_log(run, fast)
    assert (fast.velocity.tobytes(), fast.gap.tobytes()) == (run.velocity.tobytes(), run.gap.tobytes())
    assert fast.stats["error_estimate"] == run.stats["error_estimate"]


@pytest.mark.rotating
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
