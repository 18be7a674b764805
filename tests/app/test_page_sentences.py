"""Every number in the page's sentences is the library's: the answer in any language, and the reason beside it."""

import json
import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular.app.page import assemble
from tests.app.page.make_golden import compared, contacts_of, scene_of

HERE = Path(__file__).parent / "page"
NUMBER = re.compile(r"−?\d+(?:[.,]\d+)?(?:·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)?")
RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
SECONDS = {"s": 1.0, "ms": 1e-3, "µs": 1e-6, "ns": 1e-9}


def told(cases, languages, tmp_path):
    """What the page says: for each case answer, reason and answer in the story, as (key, sentences, slots)."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed: the sentences of the page are not compared here")
    keys = list(assemble.words("en"))
    texts = {one: "\n".join(assemble.words(one)[key] for key in keys) for one in assemble.LANGUAGES}
    (tmp_path / "cases.json").write_text(
        json.dumps([cases, languages, {"keys": " ".join(keys), "sentences": texts}]), encoding="utf-8")
    command = [node, str(HERE / "said.mjs"), str(tmp_path / "cases.json")]
    return json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)


def numbers(sentence, decimal):
    """All numbers of a sentence, those that belong to the names of balls and to 10⁻¹² too."""
    found = [text.replace("−", "-").replace(decimal, ".") for text in NUMBER.findall(sentence)]
    parts = [text.partition("·10") for text in found]
    return [float(number) * 10.0 ** int(raised.translate(RAISED) or "0") for number, _, raised in parts]


def is_among(value, digits, shown):
    """Whether one of the numbers shown is `value` with so many digits; takes it away."""
    size = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1) if value else 1e-12
    found = next((x for x in shown if abs(x - value) <= (0.5 + 1e-4) * size), None)
    if found is not None:
        shown.remove(found)
    return found is not None


def expected(key, slots, case, *, in_metres=False):
    """The library's numbers in a sentence of the answer, with their digits; None where it does not decide them."""
    drop = case["values"].get("height", math.nan) - (0.1 if case["scene"] == "three-balls" else 0.0)
    drop = 1.0 if in_metres else drop
    rises = [case[engine]["rise"] for engine in ("hard", "soft")]
    if (key.startswith("heights-") and None in rises) or (key == "verdict-forever" and not case["said"]):
        return None
    values = [(rise / drop, 3) for rise in rises] if key.startswith("heights-") else []
    if key == "heights-ties":
        other = compared(case["scene"], case["values"], slots["worst"]).rises[0] / drop
        if math.isnan(other):
            return None
        values.append((other, 3))
    elif key in ("verdict-ties", "verdict-shift"):
        sentence = compared(case["scene"], case["values"], case["ties"]).verdict
        values.append((float(re.search(r" by ([\d.]+) % of the fastest", sentence)[1]), 2))
    elif key.startswith("heights-") or key == "verdict-off":
        values.append((100.0 * case["error"] if case["error"] >= 1e-12 else 0.0, 2))
    if case["said"]:
        values += [(float(n), 9) for n in case["said"][-2:] if n != 1]  # one is a word in some languages
    if "parting-speeds" in json.dumps(slots):
        told_speeds = [speed for speed, *_ in (departing(slots)["soft"], departing(slots)["hard"])]
        _, *speeds = case["leaves"] or [None, *told_speeds]
        if abs(abs(speeds[0] - speeds[1]) - abs(told_speeds[0] - told_speeds[1])) < 1e-9:
            speeds = told_speeds  # of mirror images, which are off alike, either
        values += [(speed, 6 if f"{speeds[0]:.3g}" == f"{speeds[1]:.3g}" else 3) for speed in speeds]
    return values


def check_sentence(sentence, values, slots, case, decimal):
    """Check that a sentence has these numbers, and besides them numbers of balls and limits only."""
    shown = numbers(sentence, decimal)
    missing = [value for value in values if not is_among(*value, shown)]
    assert not missing, (case, sentence, missing)
    if "within" in slots and case["error"] >= 1e-12:
        bound = next(x for x in shown if 0.999 <= x / (100.0 * case["error"]) <= 2.0)
        shown.remove(bound)
    assert all(x in (*range(11), 1e-12) for x in shown), (case, sentence, shown)


def jargon(language):
    """Words of the laboratory: the drop height as a unit, the unit of the error, the tie rules."""
    words = assemble.words(language)
    fastest = max(re.split(r"\{\w+\}", words["of-fastest"]), key=len).strip(" %’")
    return [words["unit-in-drops"], fastest, "tie rule", *(words[f"tie-{rule}"] for rule in ("lower", "poisson"))]


def departing(slots):
    """The ball and the velocities of a sentence about a ball that leaves."""
    return next(one["it"] for one in (slots.get("parting"), slots.get("why")) if one and "soft" in one["it"])


@pytest.mark.parametrize(("count", "languages"), [
    (30, ["en", "de"]), pytest.param(500, list(assemble.LANGUAGES), marks=pytest.mark.soak)])
def test_every_number_of_the_answer_is_the_librarys(count, languages, tmp_path) -> None:
    """What the library says is in golden.json; what is left of a sentence are numbers of balls, and limits."""
    cases = json.loads((HERE / "golden.json").read_text(encoding="utf-8"))
    cases = [one for one in cases[:: 500 // count] if one["kind"] and one["error"] is not None]
    keys = set()
    for case, [answer, _, in_story] in zip(cases, told(cases, languages, tmp_path), strict=True):
        for (key, sentences, slots), in_metres in ((answer, False), (in_story, True)):
            values = expected(key, slots, case, in_metres=in_metres)
            if values is None:
                continue
            keys.add(key)
            for language, sentence in zip(languages, sentences, strict=True):
                check_sentence(sentence, values, slots, case, assemble.words(language)["decimal"])
                assert not (in_metres and any(word in sentence for word in jargon(language))), sentence
    assert {"heights-no", "heights-yes", "verdict-counts"} <= keys


@pytest.mark.parametrize("count", [6, pytest.param(200, marks=pytest.mark.soak)])
def test_times_and_share_of_the_reason_are_the_librarys(count, tmp_path) -> None:
    """The share of a push is summed at 80 instants, as the page does, from the forces of the library."""
    cases = json.loads((HERE / "golden.json").read_text(encoding="utf-8"))
    cases = [one for one in cases if one["error"] is not None and one["values"].get("bounces") != 2][3 :: 350 // count]
    cases, seen = cases[:count], 0
    for case, [_, (_, [sentence], slots), _] in zip(cases, told(cases, ["en"], tmp_path), strict=True):
        if "lasts" not in slots:
            continue
        name, values, (lasts, _), (arrives, _) = case["scene"], case["values"], slots["lasts"], slots["arrives"]
        soft = compared(name, values, "left").soft
        if np.isnan(soft.contacts["t_end"]).any():
            continue  # the page follows balls that settle for longer
        log = soft.contacts
        nexts = [(push, log[(log["pair"] == push["pair"] + 1) & (log["t_end"] >= push["t_begin"])]) for push in log
                 if abs(push["t_end"] - push["t_begin"] - lasts) < 1e-9 * lasts]
        late = [abs(near["t_begin"][:1] - push["t_begin"] - arrives) < 1e-9 for push, near in nexts]
        push, near = next(one for one, fits in zip(nexts, late, strict=True) if fits.any())
        times = push["t_begin"] + (np.arange(80) + 0.5) / 80 * lasts
        scene, until = scene_of(name, values)
        k, eps = contacts_of(name, values, scene.n_pairs)
        law = [gr.LinearDashpot.from_restitution(*of, p) for *of, p in zip(eps, k, scene.pairs, strict=True)]
        force = gr.md.simulate(scene, law, until=until, samples=times, t_end=times[-1]).force[:, push["pair"]]
        both = ((near["t_begin"] <= times[:, None]) & (times[:, None] <= near["t_end"])).any(axis=1)
        share = 100.0 * force[both].sum() / force.sum()
        shown = re.search(r"([\d.]+)\s(ns|µs|ms|s)\b.*?(?:([\d.]+)\s%|$)", sentence)
        assert float(shown[1]) * SECONDS[shown[2]] == pytest.approx(lasts, rel=6e-3), sentence
        assert share == pytest.approx(float(shown[3] or 0.0), abs=0.51 if share > 10 else 0.051), (sentence, share)
        seen += 1
    assert seen > count // 4
