"""A run in pieces equals the run in one, bit for bit."""

import math
from pathlib import Path

import numpy as np
import pytest

from granular import edmd, until
from granular.laws.rules import ConstantRestitution, TabulatedRestitution
from granular.run.trajectory import Status, Trajectory
from granular.scene import Scene
from tests.helpers.scenes_at_random import gas

REFERENCE = Path(__file__).parents[1] / "reference"


def box(seed, gravity=0.0, ceiling=True, tiny=False):
    """Balls between walls, or on a floor that moves; `tiny` gaps look like a collapse."""
    one = gas(seed, 12, 3.0, gravity, ceiling)
    floor = 0.1 * (not ceiling)
    return one.replace(gap=one.gap * (1e-9 if tiny else 0.5), velocity=[floor, *one.velocity[1:]])


def same_end(a, b):
    assert a.velocity[-1].tobytes() == b.velocity[-1].tobytes()
    assert a.gap[-1].tobytes() == b.gap[-1].tobytes()
    assert a.position[-1].tobytes() == b.position[-1].tobytes()
    assert a.time[-1] == b.time[-1]
    assert a.stats["events"] == b.stats["events"]


TABLE = TabulatedRestitution([0, 1], [0.9, 0.6])
RULES = {"elastic": ConstantRestitution(1.0), "mixed": [0.5, 0.9, 1.0], "table": TABLE}


def rules_of(name, scene):
    if name != "mixed":
        return RULES[name]
    return [ConstantRestitution(RULES["mixed"][c % 3]) for c in range(scene.n - 1)]


@pytest.mark.rotating
@pytest.mark.parametrize("gravity", [0.0, 1.0])
@pytest.mark.parametrize("name", ["elastic", "mixed", "table"])
@pytest.mark.parametrize("seed", range(4))
def test_cut_at_times_and_at_numbers_of_events(seed, name, gravity) -> None:
    scene = box(seed, gravity, ceiling=seed % 2 == 0, tiny=seed == 3)
    rule = rules_of(name, scene)
    whole = edmd.simulate(scene, rule, t_end=4.0)
    if whole.status in (Status.collapse, Status.bounded):
        whole = edmd.simulate(scene, rule, t_end=0.9 * float(whole.time[-1]))
    end = float(whole.time[-1])
    part = edmd.simulate(scene, rule, t_end=0.0)
    pieces = [part.contacts]
    for t in np.linspace(0.0, end, 7)[1:].tolist():
        part = edmd.resume(part, t_end=t)
        pieces.append(part.contacts)
    same_end(whole, part)
    assert np.concatenate(pieces).tobytes() == whole.contacts.tobytes()

    part = edmd.simulate(scene, rule, t_end=end, max_events=7)
    while part.status is Status.max_events:
        part = edmd.resume(part, t_end=end, max_events=13)
    same_end(whole, part)


@pytest.mark.rotating
@pytest.mark.parametrize("ties", ["left", "right", "random"])
@pytest.mark.parametrize("engine", ["sorted", "compiled"])
def test_saved_loaded_and_resumed_at_the_very_time_of_simultaneous_collisions(tmp_path, ties, engine) -> None:
    if engine == "compiled":
        pytest.importorskip("numba")
    v = [0.0, 1.0, -1.0, 1.0, -1.0, 1.0, 0.0]  # all but the end pairs collide at 1, 2, ...: two by two at one time
    scene = Scene([math.inf, *[1.0] * 5, math.inf], [0.0] * 7, [1.0, 2.0, 2.0, 2.0, 2.0, 1.0], v)
    options = {"ties": ties, "seed": 3, "engine": engine}
    whole = edmd.simulate(scene, ConstantRestitution(1.0), t_end=6.0, **options)
    times, counts = np.unique(whole.contacts["t_begin"], return_counts=True)
    assert counts.max() > 1
    pieces = []
    part = edmd.simulate(scene, ConstantRestitution(1.0), t_end=float(times[0]), max_events=1, **options)
    while True:
        pieces.append(part.contacts)
        if part.time[-1] == 6.0 and part.status is Status.time:
            break
        part.save(tmp_path / "part.npz")
        part = Trajectory.load(tmp_path / "part.npz")
        later = times[times > part.time[-1]]
        end = float(part.time[-1] if part.status is Status.max_events else later[0] if len(later) else 6.0)
        part = edmd.resume(part, t_end=end, max_events=1, engine=engine)
    same_end(whole, part)
    assert np.concatenate(pieces).tobytes() == whole.contacts.tobytes()


def test_cut_within_a_closer_look() -> None:
    scene = Scene([1.0] * 3, [0.0] * 3, [1.0, 1.0], [1.0, 0.0, -1.0])
    rule = ConstantRestitution(0.0717)
    whole = edmd.simulate(scene, rule)
    for step in (1, 10, 33):
        part = edmd.simulate(scene, rule, max_events=step)
        while part.status is Status.max_events:
            part = edmd.resume(part, max_events=step)
        same_end(whole, part)
        assert part.status is Status.collapse


@pytest.mark.rotating
@pytest.mark.parametrize(
    "options",
    [{"collapse": "merge", "merge_below": 0.05}, {"tc": 0.01}, {"elastic_below": 0.05}, {"ties": "random", "seed": 5}],
)
def test_options_are_kept(options) -> None:
    scene = box(1, 1.0, ceiling=False)
    rule = ConstantRestitution(0.7)
    whole = edmd.simulate(scene, rule, t_end=3.0, **options)
    if "ties" not in options:
        assert whole.contacts.tobytes() != edmd.simulate(scene, rule, t_end=3.0).contacts.tobytes()
    part = edmd.resume(edmd.simulate(scene, rule, t_end=0.8, **options), t_end=3.0)
    same_end(whole, part)
    assert whole.state.keys() == part.state.keys()
    for key, value in whole.state.items():
        assert np.array_equal(value, part.state[key]), key


def test_conditions_count_from_the_beginning() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=1.0)
    part = edmd.simulate(scene, ConstantRestitution(0.9), until=until.contact(0, 3))
    assert part.count(0) == 2
    more = edmd.resume(part, until=until.contact(0, 5))
    assert more.count(0) == 2
    whole = edmd.simulate(scene, ConstantRestitution(0.9), until=until.contact(0, 5))
    same_end(whole, more)


def test_late_times_cost_no_digits() -> None:
    scene = box(2)
    early = edmd.simulate(scene, ConstantRestitution(1.0), t_end=50.0)
    late = edmd.simulate(scene, ConstantRestitution(1.0), t_start=2.0**40, t_end=2.0**40 + 50.0)
    assert early.contacts["pair"].tolist() == late.contacts["pair"].tolist()
    assert early.velocity[-1].tobytes() == late.velocity[-1].tobytes()
    assert early.position[-1].tobytes() == late.position[-1].tobytes()


def test_what_cannot_be_resumed_says_why() -> None:
    scene = Scene([math.inf, 1.0], [0.0, 0.0], [1.0], [0.0, 0.0], gravity=1.0)
    run = edmd.simulate(scene, ConstantRestitution(0.5))
    with pytest.raises(ValueError, match=r"`trajectory` must be a run that can be continued, got an inelastic "
                                         r"collapse\. Run again with collapse='merge' or tc=\."):
        edmd.resume(run)
    import dataclasses

    with pytest.raises(ValueError, match="`trajectory` must be a run of hard spheres"):
        edmd.resume(dataclasses.replace(run, rule=None))
    part = edmd.simulate(scene, ConstantRestitution(0.5), t_end=1.0)
    with pytest.raises(ValueError, match=r"`t_end` must be a finite number of at least 1, got 0.5"):
        edmd.resume(part, t_end=0.5)


def test_a_closer_look_resumed_leaves_what_it_looks_at_alone() -> None:
    """The gaps of its pairs in the state are old: a ball they show at rest on the floor is not."""
    mass, v = [math.inf, 1, 2, 1, 1, 4, 2, 4, 4, 1, math.inf], [0, 3, -3, 1, 3, 2, 2, 2, 0, 2, 0]
    gap = [
        2.0477340683386976e-10, 0.6643305693377834, 0.5375236829222858, 5.492171142254724e-10, 0.9879581136579669,
        0.16525401681033036, 0.0, 0.4642018079734307, 0.20093631583579652, 0.7088885028601144,
    ]
    scene = Scene(mass, np.zeros(11), gap, v, 1.0)
    whole = edmd.simulate(scene, ConstantRestitution(0.1))
    part = edmd.simulate(scene, ConstantRestitution(0.1), max_events=34)
    pieces = [part.contacts]
    while part.status is Status.max_events:
        part = edmd.resume(part, max_events=34)
        pieces.append(part.contacts)
    same_end(whole, part)
    assert np.concatenate(pieces).tobytes() == whole.contacts.tobytes()


@pytest.mark.parametrize("name", ["floor", "falling"])
def test_run_saved_before_velocities_had_noise_goes_on(name) -> None:
    """Above a floor, saved in the middle of a closer look; and in free fall, whose frame was another one then."""
    saved = Trajectory.load(REFERENCE / f"older_{name}.npz")
    assert "noise" not in saved.state
    assert ("zoom_gap" in saved.state) is (name == "floor")
    whole = edmd.simulate(saved.scene, saved.rule)
    rest = edmd.resume(saved)
    assert (rest.status, rest.stats["events"]) == (whole.status, whole.stats["events"])
    np.testing.assert_allclose(rest.velocity[-1], whole.velocity[-1], rtol=1e-13)
    np.testing.assert_allclose(rest.position[-1], whole.position[-1], rtol=1e-13, atol=1e-15)
    both = np.concatenate([saved.contacts, rest.contacts])
    assert both["pair"].tolist() == whole.contacts["pair"].tolist()
    np.testing.assert_allclose(both["t_begin"], whole.contacts["t_begin"], rtol=1e-13)
