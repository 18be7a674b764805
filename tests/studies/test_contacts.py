"""Contact lists of other programs: values of a prototype, a slow second implementation, and runs of the package."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.comparison import measures
from granular.md.isolation import isolated_share
from granular.studies import contact_lists, contacts

TRACKER = Path(__file__).parents[1] / "reference" / "tracker.local.gz"


def test_three_contacts_by_hand():
    found = contacts.analyse([0, 1, 3], [1, 2, 4], [0.0, 0.5, 0.0], [1.0, 1.5, 1.0], particles=5, span=1.5)
    assert (found.disturbed_share, found.shared_impulse) == pytest.approx((2 / 3, 1 / 3), rel=1e-15)
    assert found.clusters == {1: 1, 2: 1}
    assert found.occupation == pytest.approx(0.8, rel=1e-15)
    assert found.disturbed.tolist() == [True, True, False]
    assert found.isolated_duration == 1.0
    assert len(found.free_times) == 0


def test_a_contact_that_begins_as_another_ends_is_not_disturbed():
    found = contacts.analyse([0, 1, 5], [1, 2, 1], [0.0, 1.0, 3.5], [1.0, 2.0, 4.0])
    assert (found.disturbed_share, found.shared_impulse) == (0.0, 0.0)
    assert found.free_times.tolist() == [1.5]
    assert found.clusters == {1: 3}


def test_the_file_of_a_tracker_gives_the_numbers_of_the_prototype():
    found = contacts.analyse(**contacts.read_lammps(TRACKER, 1.0, diameter=1.0), particles=1000)
    assert len(found.durations) == 2660
    assert found.disturbed_share == pytest.approx(0.240977, abs=5e-7)
    assert found.occupation == pytest.approx(0.0894025, rel=1e-12)
    assert found.relative_overlap == pytest.approx(0.00246036, abs=5e-9)
    assert found.deviation == pytest.approx(0.0524307, abs=5e-8)
    assert found.durations.mean() / found.isolated_duration == pytest.approx(1.0083, abs=1e-4)
    assert found.statement == "Means differ from hard spheres by up to about 5.2 %."


def by_pairs_of_contacts(i, j, begin, end, impulse, walls, n_steps=0):
    """Slow second implementation from all pairs of contacts: disturbed, shared impulse, free times, clusters."""
    n = len(i)
    bodies = [{i[k], j[k]} - set(walls) for k in range(n)]
    meets = np.zeros((n, n), bool)
    for a, b in itertools.permutations(range(n), 2):
        meets[a, b] = bool(bodies[a] & bodies[b]) and end[b] > begin[a] and begin[b] < end[a]
    shared = 0.0
    for a in range(n):
        edges = sorted({begin[a], end[a], *(min(max(t, begin[a]), end[a]) for b in np.flatnonzero(meets[a])
                                            for t in (begin[b], end[b]))})
        if len(edges) == 1:
            shared += impulse[a] * meets[a].any()
        for low, high in itertools.pairwise(edges):
            middle, width = 0.5 * (low + high), math.pi / (end[a] - begin[a])
            if any(begin[b] < middle < end[b] for b in np.flatnonzero(meets[a])):
                shared += impulse[a] * 0.5 * (math.cos((low - begin[a]) * width) - math.cos((high - begin[a]) * width))
    pauses = []
    for body in {*i, *j} - set(walls):
        mine = sorted((begin[k], end[k]) for k in range(n) if body in bodies[k])
        for k in range(1, len(mine)):
            pause = mine[k][0] - max(stop for _, stop in mine[:k])
            pauses += [pause] * (pause > 0.0)
    left, sizes = set(range(n)), []
    while left:
        todo, cluster = [left.pop()], 1
        while todo:
            new = set(np.flatnonzero(meets[todo.pop()])) & left
            left -= new
            todo += new
            cluster += len(new)
        sizes.append(cluster)
    return meets.any(axis=1), shared / sum(impulse), sorted(pauses), sorted(sizes)


def random_list(seed):
    """Random contacts without overlaps of one pair; times on a grid, so that many are equal, for even seeds."""
    random, kept = np.random.default_rng(seed), []
    n, bodies = int(random.integers(1, 60)), int(random.integers(3, 12))
    for _ in range(n):
        a, b = random.choice(bodies, 2, replace=False).tolist()
        begin = float(random.integers(0, 20)) if seed % 2 == 0 else random.uniform(0.0, 20.0)
        length = float(random.integers(0, 4)) if seed % 2 == 0 else random.exponential(2.0)
        if not any({a, b} == {c, d} and begin <= stop and start <= begin + length for c, d, start, stop in kept):
            kept.append((a, b, begin, begin + length))
    i, j, begin, end = map(list, zip(*kept, strict=True))
    return i, j, begin, end, random.uniform(0.5, 2.0, len(i)).tolist(), [0] if seed % 3 == 0 else []


@pytest.mark.rotating
def test_random_lists_agree_with_a_second_implementation():
    many = 0
    for seed in range(300):
        i, j, begin, end, impulse, walls = random_list(seed)
        if all(end[k] == begin[k] for k in range(len(i))) and len({*begin}) == 1:
            continue
        found = contacts.analyse(i, j, begin, end, impulse=impulse, walls=walls, particles=12, span=(-1.0, 40.0))
        disturbed, shared, pauses, sizes = by_pairs_of_contacts(i, j, begin, end, impulse, walls)
        assert found.disturbed.tolist() == disturbed.tolist(), seed
        assert found.shared_impulse == pytest.approx(shared, abs=1e-12), seed
        assert sorted(found.free_times.tolist()) == pytest.approx(pauses, abs=1e-12), seed
        assert found.clusters == {size: sizes.count(size) for size in sizes}, seed
        sides = [2 - (a in walls) - (b in walls) for a, b in zip(i, j, strict=True)]
        time = sum(side * (stop - start) for side, start, stop in zip(sides, begin, end, strict=True))
        assert found.occupation == pytest.approx(time / (12 * 41.0), rel=1e-12), seed
        many += disturbed.sum()
    assert many > 3000


def test_long_chains_of_links_are_one_cluster():
    n = 20_000
    order = np.random.default_rng(1).permutation(n)
    begin = np.arange(n)[order]
    found = contacts.analyse(order, order + 1, begin, begin + 1.5)
    assert found.clusters == {n: 1}
    assert contact_lists.clusters(4, np.array([3, 1]), np.array([2, 3])).tolist() == [0, 1, 1, 1]


def test_the_order_of_the_list_the_order_of_a_pair_and_the_unit_of_time_do_not_matter():
    i, j, begin, end, impulse, _ = random_list(7)
    first = contacts.analyse(i, j, begin, end, impulse=impulse)
    order = np.random.default_rng(2).permutation(len(i))
    i, j, begin, end, impulse = (np.array(x)[order] for x in (i, j, begin, end, impulse))
    second = contacts.analyse(j + 1000, i + 1000, 4.0 * begin, 4.0 * end, impulse=impulse)
    assert second.disturbed.tolist() == first.disturbed[order].tolist()
    assert second.shared_impulse == pytest.approx(first.shared_impulse, rel=1e-12)
    assert second.occupation == pytest.approx(first.occupation, rel=1e-12)
    assert second.clusters == first.clusters


def list_of(run, laws=None):
    """Contact list of a run on a line; with laws, that of hard spheres with durations of soft contacts."""
    log = run.contacts
    lower, upper = run.scene.bodies(log["pair"])
    end = log["t_end"] if laws is None else log["t_begin"] + measures.durations(run, laws)
    return contacts.analyse(lower, upper, log["t_begin"], end, impulse=log["impulse"], span=None if laws else (
        run.time[0], run.time[-1]), walls=np.flatnonzero(run.scene.is_wall))


def line(name):
    """A scene, its laws and the options of both runs."""
    cooling = gr.scenes.gas(30, packing=0.3, seed=3)
    scene = {"three balls": gr.scenes.three_balls(gap=1e-4), "far balls": gr.scenes.three_balls(gap=1e-2),
             "cradle": gr.scenes.newtons_cradle(5, gap=1e-5), "gas": gr.scenes.gas(30, packing=0.2),
             "cooling gas": cooling, "stiff cooling gas": cooling, "column": gr.scenes.column(4, gap=1e-3)}[name]
    options = {"until": gr.until.contact(0, 2)} if "balls" in name else {"t_end": 10.0 if "gas" in name else 0.1}
    k = 5e7 if "gas" not in name else 2e4 if "stiff" in name else 1e3
    laws = [gr.Hertz(1e9)] * 4 if name == "cradle" else [
        gr.LinearDashpot.from_restitution(1.0 if name == "gas" else 0.7, k=k, pair=pair) for pair in scene.pairs]
    return scene, tuple(laws), options


@pytest.mark.parametrize("name", ["three balls", "far balls", "cradle", "gas", "cooling gas", "column"])
def test_runs_on_a_line_have_the_measures_of_the_package(name):
    scene, laws, options = line(name)
    soft = gr.md.simulate(scene, list(laws), engine="plain", **options)
    found, n = list_of(soft), (~scene.is_wall).sum()
    assert len(soft.contacts) == soft.stats["contacts"] > 1
    residual = round((found.disturbed_share - (1.0 - isolated_share(soft))) * len(soft.contacts))
    assert residual == 0 or (name in ("cooling gas", "column") and residual < 0)  # overlaps without a contact
    occupied = found.durations.sum() / (soft.time[-1] - soft.time[0]) / scene.n_pairs
    assert occupied == pytest.approx(measures.occupation(soft), rel=1e-11)
    assert found.occupation >= occupied * scene.n_pairs / n


@pytest.mark.parametrize("name", ["three balls", "far balls", "gas", "stiff cooling gas", "column"])
def test_collisions_on_a_line_are_as_crowded_as_the_package_counts(name):
    scene, laws, options = line(name)
    hard = gr.edmd.simulate(scene, gr.restitution_of(list(laws), scene), engine="sorted", **options)
    assert len(hard.contacts) > 1
    assert list_of(hard, laws).disturbed_share == measures.crowding(hard, laws)


def test_numbers_of_the_prototype_for_runs_on_a_line():
    scene, laws, options = line("three balls")
    soft = gr.md.simulate(scene, list(laws), engine="plain", **options)
    found = list_of(soft)
    assert found.clusters == {5: 1}
    assert found.disturbed_share == 1.0
    assert found.durations.sum() / soft.time[-1] / scene.n_pairs == pytest.approx(0.0005944437445, rel=1e-9)
    assert found.shared_impulse == pytest.approx(0.155904, abs=5e-7)
    assert measures.shared_impulse(soft) == pytest.approx(0.1436, abs=5e-5)
    scene, laws, _ = line("cradle")
    found = list_of(gr.md.simulate(scene, list(laws), engine="plain", until=gr.until.separated()))
    assert found.clusters == {4: 1}
    assert found.shared_impulse == pytest.approx(0.934, abs=5e-4)


def gas(**changes):
    """Undisturbed contacts with Z = 0.01 and B = 0.01 π · 0.1 + 0.005."""
    n = 50
    given = {"i": 2 * np.arange(n), "j": 2 * np.arange(n) + 1, "begin": np.zeros(n), "end": np.ones(n),
             "overlap": np.full(n, 1e-3), "distance": 1.0, "particles": 100, "span": 100.0}
    return contacts.analyse(**given | changes)


@pytest.mark.parametrize(("changes", "statement"), [
    ({}, "Means agree with hard spheres within about 0.81 %."),
    ({"overlap": np.full(50, 1e-2)}, "Means differ from hard spheres by up to about 3.6 %."),
    ({"span": 1.9}, "Many contacts last: this is not a gas, and hard spheres cannot replace it."),
    ({"end": np.where(np.arange(50) < 10, 10.0, 1.0)}, "Many contacts last: this is not a gas, and hard spheres cannot "
                                                       "replace it."),
    ({"overlap": None}, "B is at least Z/2 = 0.5 %. Give the largest overlaps and R₁ + R₂ to estimate how far means "
                        "deviate from hard spheres."),
])
def test_the_statement(changes, statement):
    found = gas(**changes)
    assert found.statement == statement
    assert str(found).startswith(statement)
    for words in ("calibrated on homogeneous gases of frictionless spheres without cohesion", "not certified",
                  "Particles are not compared one by one"):
        assert words in str(found)
    assert not isinstance(found, gr.Answer)


def test_notes_of_the_report():
    assert "Z is a mean over the 100 particles of the list" in str(gas(particles=None))
    assert "3 contacts without an end." in str(gas(end=np.where(np.arange(50) < 3, np.nan, 1.0)))
    assert gas(notes="seen by eye").notes == gas(notes=["seen by eye"]).notes == ("seen by eye",)
    assert gas(end=np.where(np.arange(50) < 3, np.nan, 1.0)).durations[0] == 100.0


def test_hard_spheres_and_contacts_without_impulse_have_reports():
    found = contacts.analyse([0, 1], [1, 2], [0.0, 1.0], [0.0, 1.0], impulse=[0.0, 0.0])
    assert (found.occupation, found.disturbed_share, found.statement[:13]) == (0.0, 0.0, "B is at least")
    assert math.isnan(found.shared_impulse)
    assert math.isnan(found.relative_duration)
    assert "the mean duration is –." in str(found)
    assert "– of the impulse is shared, and the largest cluster has 1 contact. R" in str(found)
    assert "nan" not in str(found)


def test_json_has_numbers_and_no_arrays(tmp_path):
    found = gas().to_dict()
    assert (found["disturbed"], found["durations"], found["particles"]) == (0.0, 1.0, 100)
    assert found["free_times"] is None
    assert found["deviation"] == gas().deviation
    gas().to_json(tmp_path / "found.json")


def test_contacts_that_begin_before_the_span_count_only_within_it():
    found = contacts.analyse([1], [2], [-1.0], [1.0], span=2.0)
    assert (found.occupation, found.durations.tolist()) == (0.5, [2.0])


GOOD = {"i": [0, 1], "j": [1, 2], "begin": [0.0, 1.0], "end": [1.0, 2.0]}


@pytest.mark.parametrize(("changes", "match"), [
    ({"end": [1.0, 0.5]}, r"^`end\[1\]` must be a finite time not before the begin, got 0\.5\.$"),
    ({"j": [1, 1]}, r"^`j\[1\]` must be another particle than in `i`, got 1\.0\.$"),
    ({"i": [0, 1], "j": [1, 0], "begin": [0.0, 0.5]}, r"^The contacts of a pair must not overlap in time, got a second "
                                                      r"contact at 0\.5\. List each contact once\.$"),
    ({"end": [1.0]}, r"^`end` must be an array of shape \(2,\), got an array of shape \(1,\)\.$"),
    ({"i": [0]}, r"^`i` must be an array of shape \(2,\), got an array of shape \(1,\)\.$"),
    ({"impulse": [1.0]}, r"^`impulse` must be an array of shape \(2,\), got an array of shape \(1,\)\.$"),
    ({"impulse": [1.0, -1.0]}, r"^`impulse\[1\]` must be a finite number of at least 0, got -1\.0\.$"),
    ({"begin": [0.0, math.nan]}, r"^`begin\[1\]` must be a finite time, got nan\.$"),
    ({"end": [0.0, math.inf]}, r"^`end\[1\]` must be a finite time not before the begin, got inf\.$"),
    ({"i": [0, math.nan]}, r"^`i\[1\]` must be the number of a particle, got nan\.$"),
    ({"i": [0, 0.5]}, r"^`i\[1\]` must be the number of a particle, got 0\.5\.$"),
    ({"i": [0, 2.0**31]}, r"^`i\[1\]` must be the number of a particle, got 2147483648\.0\.$"),
    ({"i": ["a", "b"]}, r"^`i` must be an array of numbers, got \['a', 'b'\]\.$"),
    ({"notes": [3]}, r"^Every entry of `notes` must be a sentence, got 3\.$"),
    ({"particles": 0}, r"^`particles` must be an integer of at least 3, got 0\.$"),
    ({"particles": 2}, r"^`particles` must be an integer of at least 3, got 2\.$"),
    ({"walls": ["floor"]}, r"^`walls` must be an array of numbers, got \['floor'\]\.$"),
    ({"walls": [0, 1, 2]}, r"^`particles` must be an integer of at least 1, got 0\.$"),
    ({"distance": 0.0, "overlap": [0.1, 0.1]}, r"^`distance\[0\]` must be positive and finite, got 0\.0\.$"),
    ({"distance": [1.0], "overlap": [0.1, 0.1]}, r"^`distance` must be an array of shape \(2,\)"),
    ({"distance": 1.0, "overlap": [0.1, 1.0]}, r"^`overlap\[1\]` must be of at least 0 and less than `distance`, got"),
    ({"distance": 1.0, "overlap": [0.1, math.nan]}, r"^`overlap\[1\]` must be of at least 0"),
    ({"span": (1.0, 1.0)}, r"^`span` must be a start and a later end, got 1 and 1\.$"),
    ({"span": (3.0, 4.0)}, r"^`begin\[0\]` must be within the span from 3 to 4, got 0\.0\.$"),
    ({"i": [], "j": [], "begin": [], "end": []}, r"^`begin` must be an array of at least one contact, got an empty ar"),
])
def test_misuse_is_one_sentence(changes, match):
    with pytest.raises((TypeError, ValueError), match=match):
        contacts.analyse(**GOOD | changes)
