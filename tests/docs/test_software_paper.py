"""Every number of paper/paper.md is computed here, or is a number that another test of the repository asserts.

Each claim returns phrases of the paper with numbers formatted from results. A phrase that the paper does not contain
fails, and so does a number of the paper that is part of no phrase.
"""

import json
import math
import re
import sys
from functools import cache
from inspect import signature
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import spearmanr

import granular as gr
from bench.reference import solve
from granular.comparison.align import with_shifted_gaps
from granular.comparison.outcome import ERROR_LIMIT
from granular.studies import verification

ROOT = Path(__file__).parents[2]
SOURCE = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
BODY = " ".join(SOURCE.split("\n---\n", 1)[1].split())
BIB = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
PAGES = {name: (ROOT / "docs" / "guide" / f"{name}.md").read_text(encoding="utf-8")
         for name in ("other-codes", "frontier", "limits")}
STORED = json.loads((ROOT / "paper" / "predictors.json").read_text(encoding="utf-8"))
"""Written by `examples/paper/predictors.py --points 24 --json paper/predictors.json`."""
POINTS, LIMIT = 24, ERROR_LIMIT
MAXIMUM_WORDS, MINIMUM_WORDS = 1400, 1000
WORDS = {5: "five", 6: "six"}
sys.path.append(str(ROOT / "examples" / "paper"))


def column(name):
    """A measure of all stored runs."""
    return np.array([math.nan if x is None else x for runs in STORED["scenes"].values() for x in runs[name]])


def wrong(name):
    """Smallest number of runs on the wrong side of a limit of a measure, and the runs that it rejects wrongly."""
    x, bad = column(name), column("error") > LIMIT
    limit = min((-1.0, *x), key=lambda limit: np.sum((x > limit) != bad))
    return int(np.sum((x > limit) != bad)), (x > limit) & ~bad


def example():
    case = gr.cases.make("three-balls", gap=1e-4, restitution=0.7)
    report = gr.compare(case.scene, case.law, case.rule, until=case.until)
    soft, hard = report.soft, report.hard
    balls, (floor,) = soft.of(1), soft.of(0)
    assert floor["t_begin"] < balls["t_begin"][0]
    assert balls["t_end"][-1] < floor["t_end"]
    assert (report.answer.name, len(hard.of(1))) == ("no", 1)
    reference = {one.quantity: float(one.value) for one in verification.answers("three-balls")
                 if one.run == "restitution 0.7"}
    name = "pair 1, contact 4: velocity of the {} body after it"
    apart = reference[name.format("upper")] - reference[name.format("lower")]
    lower, upper = balls[-1]["v_out"]
    assert abs(upper - lower - apart) < 1e-14
    assert case.scene.gap.tolist() == pytest.approx([0.5, 1e-4])
    assert [law.gamma for law in case.law] == [
        gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair).gamma for pair in case.scene.pairs]
    return ("A light ball is 0.1 mm above a heavy ball, and both fall 0.5 m onto a floor, with ε = 0.7 in all contacts",
            f"leaves at {hard.of(1)[-1]['v_out'][1]:.2f} m/s. As soft", f"they have {len(balls)} contacts, all of them",
            f"the light ball leaves at {upper:.2f} m/s. The error is {report.error:.2f} of the fastest impact",
            f"separate at {apart:.11f} m/s, and `granular` agrees to 10⁻¹⁴ m/s")


def other_programs():
    """Differences in a table of docs/guide/other-codes.md, which tests/docs/test_peers.py asserts with the programs."""
    rows = dict(re.findall(r"^\| `against_(\w+)\.py` \| .* \| ([\d.·⁻⁰-⁹]+) \| [\d.·⁻⁰-⁹]+ \|$",
                           PAGES["other-codes"], re.MULTILINE))
    return (f"LAMMPS differ from the soft spheres of `granular` by at most {rows['lammps']}.",
            f"MuJoCo [@todorov2012] differ from soft spheres by {rows['mujoco']}.",
            f"Box2D differs from hard spheres by {rows['box2d']}.",
            f"pymunk differ from hard spheres by {rows['pymunk']}, and")


def hard_spheres():
    """Ratios of run times are the data of a figure; a collapse of three balls is found on one side of the limit."""
    data = json.loads((ROOT / "docs" / "figures" / "data" / "edmd-scaling.json").read_text(encoding="utf-8"))
    ratio = [data["compiled"][n] / data["bare winner tree"][n] for n in data["compiled"]]
    first, last = min(map(int, data["compiled"])), max(map(int, data["compiled"]))
    three = gr.scenes.newtons_cradle(n=3, gap=1.0)
    found = {eps: gr.edmd.simulate(three, gr.ConstantRestitution(eps)).status.name for eps in (0.0717, 0.0719)}
    assert found == {0.0717: "collapse", 0.0719: "quiet"}
    assert 0.0717 < 7.0 - 4.0 * math.sqrt(3.0) < 0.0719
    last = f"{last:,}".replace(",", " ")
    return (f"For {first} to {last} elastic balls, a compiled run takes between {min(ratio):.2f} and "
            f"{max(ratio):.2f} times as long",
            "a collapse is found at ε = 0.0717 and none at ε = 0.0719. The theoretical limit is $7 - 4\\sqrt{3}$")


def soft_spheres():
    """Run times of a table of docs/guide/frontier.md, whose ratio the soak below measures."""
    table = PAGES["frontier"].partition("<!-- three-balls -->")[2].partition("<!-- end -->")[0]
    located, other, ratio = re.search(r"^\| 10⁻⁹ \| (.*) \| DOP853 with events, (.*) \| (.*) \|$", table, re.M).groups()
    data = json.loads((ROOT / "docs" / "figures" / "data" / "frontier-three-balls.json").read_text(encoding="utf-8"))
    assert data["located"][0][1] < 5e-16
    return (f"reaches the rounding level in {located}. An eighth-order",
            f"needs {other} for an error of 10⁻⁹, {ratio} times as long",)


def comparison():
    """The answer changes at an error of 0.01; gaps are shifted by 1e-12."""
    scene = gr.scenes.three_balls()
    assert np.abs(with_shifted_gaps(scene).gap / scene.gap - 1.0) == pytest.approx(1e-12, rel=1e-3)
    return (f"Hard spheres are accepted up to an error of {ERROR_LIMIT:g}, if", "by a relative 10⁻¹², the answer")


def promises():
    number = WORDS[len(verification.names())]
    assert "| located, linear laws | 1e-14 of the impact speed × max(1, condition number) |" in PAGES["limits"]
    assert "| located, Hertz laws | 1e-12 of the impact speed × max(1, condition number) |" in PAGES["limits"]
    digits = signature(solve).parameters["digits"].default
    return (f"A solver with {digits} digits", f"reference answers for {number} scenes",
            "an error of 10⁻¹⁴ of the impact speed times the condition number of the outcome, and 10⁻¹² for Hertz's")


def measures():
    """From stored runs, some of which are computed again below, and all of them by the soak."""
    from predictors import CANDIDATE_LABELS

    error, phi = column("error"), column("shared_impulse")
    number, bad = len(error), int(np.sum(error > LIMIT))
    separate = column("crowding") == 0.0
    largest = math.ceil(1e4 * error[separate].max()) / 1e4
    (phi_wrong, rejected), (p_wrong, _), (time_wrong, _) = map(wrong, ("shared_impulse", "crowding", "occupation"))
    assert np.sum(rejected) == phi_wrong
    assert error[column("crowding") > 0.0].min() < LIMIT < error.max()
    cradles = np.repeat([name == "cradle" for name in STORED["scenes"]], [len(runs["error"]) for runs in STORED[
        "scenes"].values()])
    worst = int(np.argmax(np.where(rejected & cradles, phi, 0.0)))
    rank = {name: spearmanr(np.maximum(column(name), 1e-8), np.maximum(error, 1e-8)).statistic
            for name in ("shared_impulse", "crowding", "occupation")}
    assert rank == pytest.approx({name: STORED["rank_correlation"][name] for name in rank})
    return (f"measures for {number} runs of two balls, stacks, cradles, columns and gases",
            f"The error exceeds {LIMIT} in {bad} of them",
            f"over {WORDS[len(CANDIDATE_LABELS)]} measures of disagreement, "
            f"for {number} runs of {WORDS[len(STORED['scenes'])]} kinds of scenes",
            f"Its best limit misclassifies {time_wrong} runs, and its rank correlation with the error is "
            f"{rank['occupation']:.2f}",
            f"Its best limit misclassifies {p_wrong} runs, with a rank correlation of {rank['crowding']:.2f}. "
            f"In the {np.sum(separate)} runs with p = 0, the error is below {largest:.4f}",
            f"a rank correlation of {rank['shared_impulse']:.2f}. Its best limit wrongly rejects {phi_wrong} runs, "
            f"among them a cradle with φ = {phi[worst]:.2f} and an error of {error[worst]:.4f}")


def parameters():
    """Gaps and stiffnesses next to which the contacts or the error change."""
    def two_balls(gap):
        return gr.cases.make("three-balls", gap=gap, restitution=0.9)

    def error(gap):
        case = two_balls(gap)
        return gr.compare(case.scene, case.law, case.rule, until=case.until).error

    def separate(run):
        return run.stats["isolated"] == run.stats["contacts"] > 0

    assert [separate(two_balls(gap).simulate("md")) for gap in (2.70e-3, 2.71e-3, 4e-3)] == [False, True, True]
    assert error(2.24e-3) > LIMIT > error(2.25e-3)
    threshold = (ROOT / "docs" / "guide" / "threshold.md").read_text(encoding="utf-8")
    assert "the error of three balls is below 1 % from 0.00225 m on" in " ".join(threshold.split())
    gas = [separate(gr.md.simulate(gr.scenes.gas(6, seed=5), gr.LinearDashpot(k), t_end=100.0))
           for k in (130.0, 200.0, 400.0, 640.0, 660.0)]
    assert gas == [True, False, False, False, True]
    return ("In the two-ball problem with ε = 0.9, all contacts are separate from a gap of 2.71 mm upwards. The "
            f"error is already below {LIMIT} at 2.25 mm, and above {LIMIT} at 2.24 mm",
            "all contacts are separate for stiffnesses of 130 and 660 N/m, but not for 200, 400 and 640 N/m")


CLAIMS = (example, other_programs, hard_spheres, soft_spheres, comparison, promises, measures, parameters)


@cache
def phrases(claim):
    return claim()


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim.__name__)
def test_the_paper_states_the_numbers_of(claim):
    for phrase in phrases(claim):
        assert BODY.count(phrase) == 1, phrase


def test_no_number_of_the_paper_is_left_out():
    left = re.sub(r"\[?@\w+\]?|`[^`]*`|\]\([^)]*\)|Box2D", " ", BODY)
    for claim in CLAIMS:
        for phrase in phrases(claim):
            left = left.replace(re.sub(r"\[?@\w+\]?|`[^`]*`|Box2D", " ", phrase), " ")
    assert re.findall(r".{0,40}[\d⁰-⁹¹²³].{0,20}", left) == []


def test_a_changed_number_is_noticed():
    """Each digit of the body belongs to a phrase, so a paper with another digit has one phrase less."""
    for digit in re.finditer(r"\d", BODY.partition("# References")[0]):
        near = BODY[:digit.start()] + str((int(digit[0]) + 1) % 10) + BODY[digit.end():]
        known = re.search(r"@\w*$|`[^`]*$|Box$|\]\([^)]*$", BODY[max(0, digit.start() - 60):digit.start()])
        assert known or any(phrase not in near for claim in CLAIMS for phrase in phrases(claim)), digit


@pytest.mark.parametrize(("kind", "k"), [("two balls", 13), ("two balls", 17), ("cradle", 9), ("cradle", 14)])
def test_some_stored_runs_are_those_of_today(kind, k):
    """R1 = 0.1 m is the last of three radii, and an exponent of 3/2 the second of two."""
    from breakdown import cradle

    gap = np.geomspace(1e-7, 1e-1, POINTS)[k]
    case = gr.cases.make("three-balls", gap=gap) if kind == "two balls" else cradle(1e-2 * gap)
    at = 3 * k + 2 if kind == "two balls" else POINTS + k
    report = gr.compare(case.scene, case.law, case.rule, until=case.until, t_end=case.t_end)
    stored = {name: values[at] for name, values in STORED["scenes"][kind].items()}
    assert report.error == pytest.approx(stored["error"], rel=1e-6)
    for name in ("shared_impulse", "crowding", "occupation"):
        assert report.measures[name] == pytest.approx(stored[name], rel=1e-6, abs=1e-12)


@pytest.mark.soak
def test_all_stored_runs_are_those_of_today(monkeypatch):
    """Except the restitution, of which the paper has no number and which takes most of the time."""
    import predictors

    def restitution(case):
        return math.nan

    monkeypatch.setattr(predictors, "restitution", restitution)
    monkeypatch.setattr(predictors, "rank_correlation", lambda found, name: math.nan)
    found = predictors.compute(POINTS)
    for kind, runs in STORED["scenes"].items():
        for name, values in runs.items():
            if name not in ("restitution", "predictability"):  # the latter is the growth of rounding errors
                stored = np.array([math.nan if x is None else x for x in values])
                near = pytest.approx(stored, rel=1e-6, abs=1e-9, nan_ok=True)
                assert found["scenes"][kind][name] == near, (kind, name)


@pytest.mark.soak
def test_the_located_method_is_faster_than_a_solver_with_events_by_the_stated_ratio():
    """Within a factor of two, because both are times of one machine."""
    pytest.importorskip("numba")
    case = gr.cases.make("three-balls", gap=1e-4, restitution=0.7)
    found = gr.frontier(case.scene, case.law, until=case.until, methods=["located", "dop853+events"], repeats=5)
    time = {method: min(row.seconds for row in found.rows if row.method == method and row.velocity_error < 1e-9)
            for method in found.methods}
    assert 23.0 < time["dop853+events"] / time["located"] < 92.0


def test_the_paper_has_the_length_and_the_parts_of_its_kind():
    words = len(BODY.split())
    assert MINIMUM_WORDS <= words <= MAXIMUM_WORDS
    parts = re.findall(r"^# (.*)$", SOURCE, re.MULTILINE)
    assert parts == ["Summary", "Statement of need", "State of the field", "Method", "Validation",
                     "No simple rule replaces the comparison", "Acknowledgements", "References"]
    picture = re.findall(r"\]\(([^)@]*\.png)\)", SOURCE)
    assert [(ROOT / "paper" / path).is_file() for path in picture] == [True]


def test_references_are_complete_and_each_is_cited():
    entries = dict(re.findall(r"^@\w+\{(\w+),\n(.*?)^\}", BIB, re.MULTILINE | re.DOTALL))
    assert set(re.findall(r"@(\w+)", SOURCE.split("\n---\n", 1)[1])) == entries.keys()
    years = []
    for key, text in entries.items():
        assert re.search(r"^  doi = \{10\.\d{4,}/[^\s{}]+\}$", text, re.MULTILINE), key
        assert {"author", "title", "year"} <= set(re.findall(r"^  (\w+) = ", text, re.MULTILINE))
        years.append((key, re.search(r"year = \{(\d{4})\}", text)[1]))
    assert all(key.endswith(year) for key, year in years)
    assert all(first != second for first, second in pairwise(sorted(entries)))
