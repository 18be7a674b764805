"""Public functions given what is none of theirs: a sentence that names the argument, no error of Python or numpy."""

import inspect
import math

import numpy as np
import pytest

import granular as gr
from granular import measures
from granular.comparison import align, outcome
from granular.laws import dashpot

FLAT = gr.Scene([1.0, 2.0, 1.0], [0.1] * 3, [0.1, 0.1], [1.0, 0.0, -1.0])
LAW, RULE = gr.LinearDashpot(1e5, 10.0), gr.ConstantRestitution(0.7)
HARD = gr.edmd.simulate(FLAT, RULE, t_end=1.0)
SOFT = gr.md.simulate(FLAT, LAW, t_end=1.0, engine="plain")
GOOD = {"hard": HARD, "soft": SOFT, "cut": SOFT, "run": HARD, "one": HARD, "other": SOFT, "trajectory": HARD,
        "scene": FLAT, "twin": HARD, "weight": np.ones(2), "fastest": np.ones(2), "most": np.ones(2), "options": {},
        "parts": outcome.components(HARD, SOFT), "laws": (LAW,) * 2, "speed": 1.0}
ODD = (None, "x", [[1], [1, 2]], math.nan, -1, 0, object(), 10**400, np.float64(1.0), 1j, True)
RAGGED = [[1.0], [1.0, 2.0]]


def functions():
    """Public functions that take a run, with the names of their arguments."""
    for home in (outcome, align, measures):
        for name, function in vars(home).items():
            if inspect.isfunction(function) and function.__module__ == home.__name__ and not name.startswith("_"):
                yield pytest.param(function, list(inspect.signature(function).parameters), id=f"{home.__name__}.{name}")


@pytest.mark.parametrize(("function", "names"), list(functions()))
def test_what_is_no_run_is_refused(function, names):
    for name in {"hard", "soft", "cut", "run", "one", "other", "scene", "twin", "weight", "options"} & set(names):
        for odd in ODD:
            given = [odd if one == name else GOOD.get(one) for one in names]
            with pytest.raises((TypeError, ValueError), match=rf"(?s)^`{name}` must be .*, got .*\.$"):
                list(function(*given))


MISUSE = {
    "no scene": (lambda: gr.scene.in_order(None), r"`scene` must be a granular\.Scene, such as "
                                                  r"granular\.scenes\.three_balls\(\), got None\."),
    "no scene for speeds": (lambda: gr.scene.speed_scale("x"), r"`scene` must be a granular\.Scene, such as "
                                                               r"granular\.scenes\.three_balls\(\), got 'x'\."),
    "zeta is None": (lambda: dashpot.restitution(None), "`zeta` must be a single number, got None"),
    "zeta is a list": (lambda: dashpot.restitution([1.0]), r"`zeta` must be a single number, got \[1.0\]"),
    "ragged samples": (
        lambda: gr.edmd.simulate(FLAT, RULE, t_end=1.0, samples=RAGGED),
            r"`samples` must be an.*, got \[\[1.0\], \[1.0, 2.0\]\]"),
    "ragged samples, soft": (lambda: gr.md.simulate(FLAT, LAW, t_end=1.0, samples=RAGGED), "`samples` must be an "
                                                                                           "array of numbers, got "
                                                                                           r"\[\[1\.0\], \[1\.0, "
                                                                                           r"2\.0\]\]\."),
    "ragged gaps": (lambda: gr.scenes.column(3, gap=RAGGED), r"`gap` must be an array of numbers, got \[\[1.0\], .*"),
    "ragged gaps of pendula": (lambda: gr.scenes.pendulum_cradle(3, rest_gap=RAGGED), "`rest_gap` must be an array of "
                                                                                      r"numbers, got \[\[1\.0\], "
                                                                                      r"\[1\.0, 2\.0\]\]\."),
    "ragged restitution": (lambda: gr.ConstantRestitution(RAGGED),
        r"`restitution` must be an array of.*, got \[\[1.0\], .*"),
    "ragged restitution of theory": (
        lambda: gr.theory.stack_velocities([1.0, 1.0], RAGGED),
            r"`restitution` must be an array of numbers.*, got \[\[1.0\], .*"),
    "ragged speed": (
        lambda: gr.binary.restitution(LAW, FLAT.pairs[0], RAGGED),
            r"`speed` must be an array of numbers.*, got \[\[1.0\], .*"),
    "ragged modulus": (
        lambda: gr.Hertz.from_material(RAGGED, 0.3, FLAT.pairs[0]),
            r"`young` must be an array of numbers.*, got \[\[1.0\], .*"),
    "ragged values": (lambda: gr.sweep("three-balls", {"gap": [1.0, [2.0]]}), "The values of gap must be a list of "
                                                                              r"numbers or words, got \[1\.0, "
                                                                              r"\[2\.0\]\]\."),
    "ragged coefficients": (lambda: gr.walls.Piecewise([0.0, 1.0], RAGGED),
        r"`coefficients` must be an array.*, got \[\[1.0\], .*"),
    "ragged series": (lambda: gr.walls.Panels([0.0, 1.0], RAGGED),
        r"`series` must be an array of numbers.*, got \[\[1.0\], .*"),
    "contact of a word": (lambda: gr.until.Contact("x", 1), "`pair` must be a single number, got 'x'"),
    "contact number 0": (lambda: gr.until.Contact(0, 0), "`nth` must be an integer of at least 1, got 0"),
    "speed of a word": (lambda: gr.until.Speed(0, "x"), "`above` must be a single number, got 'x'"),
    "force below zero": (lambda: gr.until.Force(0, -1.0), "`above` must be a finite number of at least 0, got -1.0"),
    "no place": (lambda: gr.until.Position(0), "One of `above` and `below` must be given, a position in m, got None "
                                               "and None"),
    "two places": (lambda: gr.until.Position(0, 1.0, 0.0), "One of `above` and `below` must be given, a position in "
                                                           "m, got 1.0 and 0.0"),
    "place is nan": (lambda: gr.until.Position(0, below=math.nan), "`below` must be a finite number.*, got nan"),
    "rows of a word": (lambda: HARD.of("x"), "`pair` must be a single number, got 'x'"),
    "count of half a pair": (lambda: HARD.count(0.5), "`pair` must be an integer of at least 0, got 0.5"),
    "no laws": (lambda: measures.durations(HARD, ()), r"The length of `laws` must be 2 \(the number of pairs\), got 0"),
    "laws of another scene": (lambda: measures.crowding(HARD, (LAW,) * 3), "The length of `laws` must be 2 .*, got 3"),
    "groups at a word": (lambda: measures.groups(FLAT, (LAW,) * 2, "x"), "`speed` must be a single number, got 'x'"),
    "resolution of one": (
        lambda: gr.compare(FLAT, LAW, t_end=1.0).effective_restitution(resolution=1),
        "`resolution` must be an integer of at least 2.*, got 1"),
    "no frequency": (
        lambda: gr.walls.Sine.from_acceleration(1.0, 1e-320), r"`frequency` must be a finite number of at "
                                                              "least 1e-150, got 1e-320"),
    "radius beyond all": (
        lambda: gr.waves.solitary(20, law=gr.Hertz(1e9), radius=1e200),
            r"`radius` must be a number in \(0, 1e\+100\], got 1e\+200"),
    "masses beyond all": (lambda: gr.scenes.chain(5, mass_ratio=1e300),
        r"`mass\[\d\]` must be finite, got inf\. Only the first and"),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("call", "sentence"), MISUSE.values(), ids=MISUSE)
def test_misuse_is_one_sentence(call, sentence):
    with pytest.raises((TypeError, ValueError), match="^" + sentence):
        call()


def test_one_law_stands_for_all_pairs_and_numpy_numbers_are_numbers():
    assert (measures.durations(HARD, LAW) == measures.durations(HARD, (LAW, LAW))).all()
    assert HARD.of(np.int64(1)).tobytes() == HARD.of(1).tobytes()
    assert gr.until.Contact(np.int64(1), 2.0) == gr.until.contact(1, 2)
    touching = gr.edmd.simulate(FLAT.replace(gap=[0.0, 0.0]), RULE)
    assert next(align.other_tie_rules(touching, {}))["ties"] == "right"
