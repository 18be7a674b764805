"""The file of a sweep: those who ask the same go on with it, and nobody else; and nothing is solved in vain."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import granular as gr
from granular.studies.sweeps.plan import make_plan, question

GAPS = {"gap": [1e-4, 1e-3]}


def made(gap, eps=0.7):
    scene = gr.scenes.three_balls(gap=gap)
    law = [gr.LinearDashpot.from_restitution(eps, k=5e7, pair=pair) for pair in scene.pairs]
    return gr.Case(scene, law, until=gr.until.contact(0, 2))


def from_text(text, **scope):
    """A function or class as a script has it that is edited and run again."""
    here = {"__name__": "__main__", "gr": gr, "np": np, "made": made, "dataclass": dataclass} | scope
    exec(compile(text, "script.py", "exec"), here)
    return here["it"]


OWN = {
    "function": "def it(gap): return made(gap, 0.7)",
    "lambda": "it = lambda gap: made(gap, 0.7)",
    "method": "class Of:\n  def case(self, gap): return made(gap, 0.7)\nit = Of().case",
    "partial": "from functools import partial\nit = partial(made, eps=0.7)",
}


@pytest.mark.parametrize("text", OWN.values(), ids=OWN)
def test_an_own_function_is_continued_only_with_the_same_key(text, tmp_path) -> None:
    file, keyed = tmp_path / "a.nc", tmp_path / "b.nc"
    gr.sweep(from_text(text), GAPS, "v_rel", save=file)
    for key, sentence in ((None, "could have changed since\\. Give a key"), ("1", "of another sweep")):
        with pytest.raises(ValueError, match=sentence):
            gr.sweep(from_text(text), GAPS, "v_rel", save=file, key=key)
    before, solved = gr.sweep(from_text(text), GAPS, "v_rel", save=keyed, key="1"), []
    again = gr.sweep(from_text(text), GAPS, "v_rel", save=keyed, key="1", on_progress=lambda *done: solved.append(done))
    assert np.array_equal(before.v_rel, again.v_rel)
    assert not solved
    with pytest.raises(ValueError, match="of another sweep"):
        gr.sweep(from_text(text), GAPS, "v_rel", save=keyed, key="2")


LAW = """
{frozen}class Own:
    k = {k}
    def force(self, xi, xi_dot, pair): return self.k * xi + 50.0 * xi_dot
scene = gr.Scene([1.0, 1.0, 1.0], [0.01] * 3, [1e-3] * 2, [1.0, 0.0, 0.0])
it = gr.Case(scene, Own(), t_end=0.05)
"""


@pytest.mark.parametrize("frozen", ["", "@dataclass(frozen=True)\n"])
def test_an_own_law_is_continued_only_with_a_key(frozen, tmp_path) -> None:
    file, (soft, same) = tmp_path / "a.nc", (from_text(LAW.format(frozen=frozen, k=5e5)) for _ in range(2))
    before = gr.sweep(soft, GAPS, "duration", save=file, key="k = 5e5")
    assert np.array_equal(gr.sweep(same, GAPS, "duration", save=file, key="k = 5e5").duration, before.duration)
    for key, sentence in ((None, "Own.*could have changed since"), ("k = 5e6", "of another sweep")):
        with pytest.raises(ValueError, match=sentence):
            gr.sweep(same, GAPS, "duration", save=file, key=key)


def test_code_is_found_wherever_it_takes_part() -> None:
    scene, law = gr.scenes.three_balls(), gr.Hertz(1e9)
    shaken = gr.scenes.bouncing_ball(plate=gr.walls.Motion(lambda t: 0.0 * t))
    within = gr.restitution_of(from_text(LAW.format(frozen="@dataclass(frozen=True)\n", k=5e5)).law)
    for case, asked, many in [
        (gr.Case(scene, law, gr.ConstantRestitution(0.5), gr.until.contact(0, 2)), ("contacts",), 0),
        (gr.Case(scene, law, gr.restitution_of(law)), ("contacts",), 0),
        (gr.Case(shaken, law, t_end=1.0), ("contacts",), 1),
        (gr.Case(scene, law, lambda speed, pair: 0.5), ("contacts",), 1),
        (gr.Case(scene, law, within), ("contacts",), 1),
        (gr.Case(scene, law), (counted,), 1),
        (made, ("contacts",), 1),
        (gr.scenes.three_balls, ("contacts",), 0),
    ]:
        text, own = question(make_plan(case, {}, asked, {}))
        assert len(own) == many, text
        assert "0x" not in text


def test_numbers_of_laws_and_all_entries_of_arrays_are_in_the_text() -> None:
    def asked(case, **fixed):
        return question(make_plan(case, {}, ("contacts",), fixed))[0]

    scene = gr.scenes.three_balls()
    assert asked(gr.Case(scene, gr.Hertz(1e9))) == asked(gr.Case(scene, gr.Hertz(1e9)))
    assert asked(gr.Case(scene, gr.Hertz(1e9))) != asked(gr.Case(scene, gr.Hertz(1.1e9)))
    still = np.zeros(1200)
    moved = still.copy()
    moved[600] = 1.0
    case = gr.Case(scene, gr.Hertz(1e9))
    assert asked(case, gap=still) != asked(case, gap=moved)


def test_a_file_that_names_laws_by_older_places_is_continued(tmp_path) -> None:
    case, file = gr.Case(gr.scenes.three_balls(), gr.Hertz(1e9), until=gr.until.contact(0, 2)), tmp_path / "a.nc"
    data = gr.sweep(case, {"gravity": [9.8, 9.9]}, "contacts", save=file)
    older = data.attrs["question"].replace('"Hertz"', '"granular.laws.springs.Hertz"')
    assert older != data.attrs["question"]
    data.assign_attrs(question=older).to_netcdf(file, engine="netcdf4")
    solved: list = []
    gr.sweep(case, {"gravity": [9.8, 9.9]}, "contacts", save=file, on_progress=lambda *done: solved.append(done))
    assert not solved


def test_an_interruption_before_the_first_answer_leaves_no_file(tmp_path) -> None:
    text = "def it(gap):\n  if STOPS: raise KeyboardInterrupt\n  return made(gap)"
    with pytest.raises(KeyboardInterrupt):
        gr.sweep(from_text(text, STOPS=True), GAPS, "v_rel", save=tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_a_refused_sweep_is_refused_again(tmp_path) -> None:
    for _ in range(2):
        with pytest.raises(ValueError, match=r"`restitution` must be a number in \(0, 1\], got 1\.5"):
            gr.sweep("three-balls", {"restitution": [1.5, 2.0]}, "v_rel", save=tmp_path / "a.nc")


def counted(case):
    SOLVED.append(case)
    return 1.0


SOLVED: list = []


def named(name):
    one = partial(counted)
    if name:
        one.__name__ = name  # type: ignore[attr-defined]
    return one


@pytest.mark.parametrize(("result", "options", "sentence"), [
    (counted, {"save": "none/a.nc"}, r"a\.nc: The directory 'none' does not exist\. Create it first"),
    (lambda case: counted(case), {"save": "a.nc"}, "must be a function with a name to be saved, got '<lambda>'"),
    (named("gap"), {}, "must be a function whose name is new in the data set, got 'gap'"),
    (named("status"), {}, "must be a function whose name is new in the data set, got 'status'"),
    ([named("one"), named("one")], {}, "must be a function whose name is new in the data set, got 'one'"),
    (named(""), {}, "`result` must be a function with a name, got "),
    ("contacts", {"refine": "law", "over": {"law": ["Hertz", "TsujiHertz"]}}, "`refine` must name a parameter of "
                                                                              "numbers, got 'law' with values"),
])
def test_nothing_is_solved_in_vain(result, options, sentence, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    SOLVED.clear()
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.sweep("three-balls", options.pop("over", GAPS), result, **options)
    assert SOLVED == []
    assert list(tmp_path.iterdir()) == []


def test_a_result_that_is_no_number_is_told() -> None:
    with pytest.raises(TypeError, match=r"The result 'wide' must be a single number, got array"):
        gr.sweep("three-balls", GAPS, from_text("def wide(case): return np.ones(3)\nit = wide"))


def test_jumps_along_a_whole_number_are_between_whole_numbers() -> None:
    found = gr.sweep("newtons-cradle", {"n": [2, 3, 6]}, "contacts", refine="n")
    assert found.edge.values.tolist() == [[2.0, 3.0], [3.0, 4.0], [4.0, 5.0], [5.0, 6.0]]


def test_a_midpoint_that_is_refused_is_no_jump() -> None:
    def case(gap: float) -> gr.Case:
        if 2e-4 < gap < 9e-4:
            raise ValueError("gap is none of mine.")
        return made(gap)

    found = gr.sweep(case, GAPS, "contacts", refine="gap")
    assert found.edge.values.tolist() == [[1e-4, 1e-3]]
    assert (found.edge_contacts.values >= 0).any(axis=-1).all()
