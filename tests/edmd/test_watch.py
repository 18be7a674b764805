"""A watched hard run against a count of all pairs of rows of its log, durations against single contacts, and soft runs.
"""

import math
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.app.cli import main
from granular.edmd import compiled_queue as blocks, queue_choice, run
from granular.edmd.watch import Watch
from granular.md import isolation
from tests.helpers.scenes_at_random import gas
from tests.helpers.whole_states import check_watch

ELASTIC = gr.ConstantRestitution(1.0)


@dataclass(frozen=True)
class Own:
    """A law that says nothing of itself."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi * (1.0 + xi)


@dataclass(frozen=True)
class Wall:
    """A law with a bounded force: fast balls go through it."""

    def force(self, xi, xi_dot, pair):
        return 1e3 * xi / (1.0 + (1e3 * xi) ** 4)


def alone(law, pair, speed):
    try:
        return gr.binary.collision(law, pair, speed).duration
    except ValueError:
        return math.inf


def brute(scene, log, laws):
    """Numbers of disturbed rows, and the first later one with its lower pair, by looking at every two rows."""
    slowest = isolation.SLOWEST_SPEED_RATIO * (
        np.ptp(scene.velocity) + math.sqrt(2.0 * scene.gravity * scene.gap.sum())
    )
    speed = np.maximum(log["v_in"][:, 0] - log["v_in"][:, 1], slowest)
    pair, time = log["pair"].tolist(), log["t_begin"].tolist()
    lasting = [alone(laws[c], scene.pairs[c], v) for c, v in zip(pair, speed.tolist(), strict=True)]
    disturbed, later = set(), []
    for i, j in combinations(range(len(log)), 2):
        beside, over = abs(pair[i] - pair[j]) == 1, pair[i] in pair[i + 1 : j]
        if beside and not over and time[j] - time[i] <= lasting[i]:
            disturbed |= {i, j}
            later.append((j, min(pair[i], pair[j])))
    if not later:
        return 0, (math.nan, -1)
    j, lower = min(later)
    return len(disturbed), (time[j], lower)


def same(one, other):
    """Whether two of (watched, first_disturbed) are the same, which may be nan."""
    return repr(one) == repr(other)


def watched(run):
    return run.stats["watched"], run.first_disturbed


LAWS = {
    "dashpot": lambda t: gr.LinearDashpot((math.pi / t) ** 2, 0.2 / t),
    "hertz": lambda t: gr.Hertz((3.0 / t) ** 2.5),
    "viscoelastic": lambda t: gr.ViscoelasticHertz((3.0 / t) ** 2.5, 0.3 * (3.0 / t) ** 1.5),
    "tsuji": lambda t: gr.TsujiHertz((3.0 / t) ** 2.5, 0.2),
}
SCENES = {
    "gas": lambda seed: gas(seed, 9, 0.0),
    "unlike": lambda seed: gas(seed, 8, 2.0),
    "column": lambda seed: gas(seed, 6, 0.5, gravity=1.0, ceiling=False),
    "touching": lambda seed: gas(seed, 8).replace(gap=np.arange(9) % 3 * 0.3 + 0.1 * (np.arange(9) < 1)),
    "tiny": lambda seed: gas(seed, 8, 1.0).replace(gap=np.geomspace(1e-9, 1.0, 9)),
}


@pytest.mark.rotating
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.soak)])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", SCENES)
def test_counts_what_looking_at_every_two_rows_finds(name, law, seed, monkeypatch):
    take = Watch.take
    monkeypatch.setattr(Watch, "take", lambda self, *given: (take(self, *given), check_watch(self)))
    scene = SCENES[name](seed)
    most = 30 if law in ("viscoelastic", "tsuji") else 120  # whose single contacts take long
    laws = [LAWS[law](0.01 * 3.0**seed * (1.0 + 0.3 * (p.index % 2))) for p in scene.pairs]
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.9), t_end=3.0, max_events=most, watch=laws, engine="sorted")
    assert same(watched(hard), brute(scene, hard.contacts, laws))


def test_the_check_for_tests_leaves_what_it_looks_at():
    watch = Watch(gr.Hertz(1e7), gr.scenes.heated_gas(3), isolation.Durations)
    watch.last["began"] = 0.5
    watch.last["lasting"][1:-1] = 0.1  # and none at thermal walls
    before = watch.last.copy()
    check_watch(watch)
    assert (watch.last == before).all()


def test_the_scenes_above_are_watched_with_and_without_result():
    found = []
    for name, make in SCENES.items():
        for t in (1e-5, 0.01, 0.1):
            hard = gr.edmd.simulate(make(0), ELASTIC, t_end=3.0, max_events=120, watch=LAWS["dashpot"](t))
            found.append((name, hard.stats["watched"], hard.stats["events"]))
    assert any(k == 0 for _, k, n in found if n > 5)
    assert any(0 < k < n for _, k, n in found)


@pytest.mark.parametrize("margin", [-1e-6, -1e-12, 1e-12, 1e-6])
@pytest.mark.parametrize("start", [0.0, 1e12])
def test_one_contact_is_over_as_the_next_begins_or_is_not(margin, start):
    """The middle ball is hit at t = 1 with 1 m/s, and arrives at the third after the duration of that contact."""
    law = gr.LinearDashpot(5e3)
    lasting = gr.binary.collision(law, gr.Pair(0.5, 0.0, 0), 1.0).duration
    scene = gr.Scene([1.0] * 3, [0.0] * 3, [1.0, lasting * (1.0 + margin)], [1.0, 0.0, 0.0])
    hard = gr.edmd.simulate(scene, ELASTIC, t_start=start, watch=law)
    assert hard.stats["watched"] == (0 if margin > 0.0 else 2)
    assert hard.first_disturbed[1] == (-1 if margin > 0.0 else 0)
    if margin < 0.0:
        assert hard.first_disturbed[0] == hard.contacts["t_begin"][1]


def test_collisions_of_one_pair_alone_do_not_count():
    ball = gr.scenes.bouncing_ball()
    hard = gr.edmd.simulate(ball, gr.ConstantRestitution(0.5), watch=gr.LinearDashpot(1.0))
    assert hard.stats["events"] > 10
    assert watched(hard)[0] == 0
    assert math.isnan(hard.first_disturbed[0])
    assert hard.first_disturbed[1] == -1


@pytest.mark.parametrize("ties", ["left", "right", "poisson"])
def test_touching_balls_are_counted_all(ties):
    hard = gr.edmd.simulate(gr.scenes.newtons_cradle(n=4), ELASTIC, ties=ties, watch=gr.Hertz(1e9))
    assert hard.stats["watched"] == len(hard.contacts) >= 3


@pytest.mark.rotating
@pytest.mark.parametrize("option", [{"engine": "sorted"}, {"engine": "compiled"}, {"log": False}, {"samples": 7}, {}])
def test_same_with_every_engine_and_option(option, monkeypatch):
    if option.get("engine") == "compiled":
        pytest.importorskip("numba")
    scene, law = gas(5, 40, 1.0), LAWS["hertz"](0.02)
    plain = gr.edmd.simulate(scene, gr.ConstantRestitution(0.95), t_end=20.0, engine="sorted")
    monkeypatch.setattr(run, "REPORT_EVENTS", 100)
    rows = []
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.95), t_end=20.0, watch=law, on_event=rows.append, **option)
    assert hard.velocity[-1].tobytes() == plain.velocity[-1].tobytes()
    assert same(watched(hard), brute(scene, plain.contacts, [law] * scene.n_pairs))
    assert len(rows) == len(plain.contacts)
    assert len(hard.contacts) == (0 if option.get("log") is False else len(rows))
    quiet = gr.edmd.simulate(scene, gr.ConstantRestitution(0.95), t_end=20.0, watch=law, **option)
    assert same(watched(quiet), watched(hard))


def test_same_where_a_run_would_be_made_in_blocks_and_from_sorted_to_compiled(monkeypatch):
    pytest.importorskip("numba")
    scene, law = gas(6, 60), LAWS["hertz"](0.02)
    once = watched(gr.edmd.simulate(scene, ELASTIC, t_end=30.0, watch=law, engine="sorted"))
    monkeypatch.setattr(blocks, "BLOCKS_ABOVE", 10)
    assert same(watched(gr.edmd.simulate(scene, ELASTIC, t_end=30.0, watch=law, engine="compiled", log=False)), once)
    monkeypatch.setattr(run, "compilation_pays", lambda work, has: work > 500)
    monkeypatch.setattr(queue_choice, "EXTRAPOLATION_WORK", 600)
    monkeypatch.setattr(queue_choice, "EXPECTED_PER_PAIR", 1)
    assert same(watched(gr.edmd.simulate(scene, ELASTIC, t_end=30.0, watch=law, max_events=3000)), once)


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ["sorted", "compiled"])
@pytest.mark.parametrize("name", ["gas", "column", "tiny"])
def test_in_pieces_as_in_one_saved_and_loaded(name, engine, tmp_path):
    if engine == "compiled":
        pytest.importorskip("numba")
    scene, law, rule = SCENES[name](1), LAWS["hertz"](0.15), gr.ConstantRestitution(0.95)
    whole = gr.edmd.simulate(scene, rule, t_end=6.0, max_events=400, watch=law, engine=engine)
    part = gr.edmd.simulate(scene, rule, t_end=6.0, max_events=13, watch=law, engine=engine)
    while part.status is gr.Status.max_events and part.stats["events"] < 400:
        part.save(tmp_path / "part.npz")
        part = gr.Trajectory.load(tmp_path / "part.npz")
        left = 400 - part.stats["events"]
        part = gr.edmd.resume(part, t_end=6.0, max_events=min(left, 13), watch=law, engine=engine)
    assert whole.stats["watched"] > 2
    assert same(watched(whole), watched(part))
    assert "; watch: " in whole.message


def test_a_run_that_was_not_watched_is_from_then_on():
    scene, law = gas(2, 9), LAWS["dashpot"](0.05)
    half = gr.edmd.simulate(scene, ELASTIC, t_end=3.0)
    rest = gr.edmd.resume(half, t_end=9.0, watch=law)
    assert same(watched(rest), brute(scene, rest.contacts, [law] * scene.n_pairs))
    assert "watched" not in gr.edmd.resume(rest, t_end=10.0).stats


def test_late_times_have_their_digits():
    scene, law = gas(3, 20), LAWS["dashpot"](1e-3)
    early, late = (gr.edmd.simulate(scene, ELASTIC, t_start=t, t_end=t + 256.0, watch=law) for t in (0.0, 2.0**52))
    assert 0 < early.stats["watched"] == late.stats["watched"]


def test_a_closer_look_at_a_collapse_is_watched_too():
    scene, law = gr.scenes.newtons_cradle(n=3, gap=1.0), gr.LinearDashpot(1e6)
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.0717), watch=law)
    assert hard.status is gr.Status.collapse
    assert hard.stats["zoomed"] > 20
    assert hard.stats["watched"] > 20
    assert same(watched(hard), brute(scene, hard.contacts, [law] * 2))


@pytest.mark.rotating
def test_no_two_first_contacts_of_soft_spheres_overlap_unwarned():
    """Forces only push, so the soft ball between two others is never ahead of the hard one: warnings come too often."""
    rng, seen = np.random.default_rng(4), []
    for law in [make(0.1) for make in LAWS.values()] * 8:
        mass, late = np.exp(rng.uniform(-1.0, 1.0, 3)), rng.uniform(0.0, 0.15)
        scene = gr.Scene(mass, [0.0] * 3, [0.0, 1.0], [1.0, 0.0, rng.uniform(-1.0, 0.5)])
        after = gr.edmd.simulate(scene, gr.restitution_of(law), max_events=1).contacts["v_out"][0]
        scene = scene.replace(gap=[0.0, max(1e-3, late * (after[1] - scene.velocity[2]))])
        hard = gr.edmd.simulate(scene, gr.restitution_of(law), t_end=1.0, max_events=2, watch=law)
        soft = gr.md.simulate(scene, law, until=gr.until.contact(0, 2), t_end=1.0, engine="plain")
        overlaps = measures.overlapping(soft)
        seen.append((hard.stats["watched"] > 0, len(overlaps) > 0))
    assert (False, True) not in seen
    assert {(True, True), (True, False), (False, False)} == set(seen)


@pytest.mark.rotating
def test_durations_are_those_of_single_contacts():
    rng = np.random.default_rng(0)
    scene = gas(0, 7, 1.0, gravity=1.0)
    each = [make(0.01) for make in LAWS.values()]
    laws = [*each, gr.PowerLaw(1e4, 2.5), Own(1e3), gr.WaltonBraun(1e3, 2e3), gr.LinearDashpot(1e3, 1e3)]
    pair, speed = rng.integers(0, scene.n_pairs, 30), 10.0 ** rng.uniform(-1.0, 0.5, 30)
    found = isolation.Durations(laws, scene)(pair, speed)
    for c, v, t in zip(pair.tolist(), speed.tolist(), found.tolist(), strict=True):
        loose = {"ViscoelasticHertz": 1e-7, "Own": 1e-5}.get(type(laws[c]).__name__, 1e-13)
        assert t == pytest.approx(gr.binary.collision(laws[c], scene.pairs[c], v).duration, rel=loose)


@pytest.mark.rotating
def test_contacts_without_an_end_last_until_their_pair_collides_again():
    scene = gr.Scene([1.0, 1.0, 1.0], [0.0] * 3, [1.0, 1.0], [1.0, 0.0, 0.0])
    hard = gr.edmd.simulate(scene, ELASTIC, watch=Wall(), t_end=9.0)
    assert hard.stats["watched"] == 2


def test_pairs_of_all_sizes_share_their_contacts(monkeypatch):
    ran = []
    collision = gr.binary.collision
    monkeypatch.setattr(gr.binary, "collision", lambda *given: ran.append(0) or collision(*given))
    scene = gas(1, 50, 2.0)
    isolation.Durations([gr.TsujiHertz(1e6, 0.3)] * scene.n_pairs, scene)(np.arange(51), np.ones(51))
    assert len(ran) == 1


@pytest.mark.parametrize(
    ("watch", "kind", "sentence"),
    [
        (gr.ConstantRestitution(0.7), TypeError,
            r"^`watch` must be an object with force\(self, xi, xi_dot, pair\), got "
            r"ConstantRestitution\(restitution=0\.7\)\. A collision rule does not determine the duration of a "
            r"contact\."),
        (1e-3, TypeError, r"^`watch` must be an object with force.*, got 0.001"),
        (gr.Hertz, TypeError, r"^`watch` must be an instance, such as Hertz\(k=\.\.\.\), got the class Hertz\."),
        ([gr.Hertz(1e9)], ValueError,
            r"^The length of `watch` must be 2 \(the number of pairs\), got 1\. Give one for all"),
    ],
)
def test_misuse_is_a_sentence(watch, kind, sentence):
    scene = gr.scenes.three_balls()
    with pytest.raises(kind, match=sentence):
        gr.edmd.simulate(scene, ELASTIC, t_end=1.0, watch=watch)
    half = gr.edmd.simulate(scene, ELASTIC, max_events=2)
    with pytest.raises(kind, match=sentence):
        gr.edmd.resume(half, t_end=1.0, watch=watch)


def test_the_sentence_says_how_many_and_where_and_that_it_is_no_proof():
    scene, law = gr.scenes.three_balls(gap=1e-9), gr.LinearDashpot(5e7)
    hard = gr.edmd.simulate(scene, ELASTIC, max_events=2, watch=law)
    first = f"the first at pairs floor–1 and 1–2 at t = {hard.contacts['t_begin'][1]:.9g} s (an estimate)"
    words = "watch: 2 of 2 collisions would, as soft contacts, overlap in time with a contact of a neighbouring pair, "
    assert words + first in hard.message
    far = gr.edmd.simulate(scene.replace(gap=[0.5, 0.1]), ELASTIC, max_events=2, watch=law)
    assert "watch: none of 2 collisions" in far.message
    assert "watch" not in gr.edmd.simulate(scene, ELASTIC, max_events=2).message


def test_the_command_watches_with_the_law_of_the_scene_if_asked(capsys):
    words = ["run", "gas", "--n", "9", "--t-end", "5"]
    assert main([*words, "--engine", "edmd"]) == 0
    assert "watch" not in capsys.readouterr().out
    assert main([*words, "--engine", "edmd", "--watch"]) == 0
    assert "collisions would, as soft contacts, overlap" in capsys.readouterr().out
    assert main([*words, "--watch"]) == 2
    assert "md.simulate has no option `watch`; available: " in capsys.readouterr().err


def test_nobody_looked_is_nothing_found_and_counters_are_saved(tmp_path):
    hard = gr.edmd.simulate(gr.scenes.newtons_cradle(n=3, gap=1.0), gr.ConstantRestitution(0.0717))
    assert same(hard.first_disturbed, (math.nan, -1))
    hard.save(tmp_path / "run.npz")
    assert gr.Trajectory.load(tmp_path / "run.npz").stats == hard.stats
