"""The file of a sweep: those who ask the same go on with it, and nobody else; and nothing is solved in vain."""

from dataclasses import dataclass
from functools import partial

import numpy as np
import pytest

import granular as gr
from granular.sweeps.identity import identity

GAPS = {"gap": [1e-4, 1e-3]}
EPS = 0.7


def made(gap, eps=0.7):
    scene = gr.scenes.three_balls(gap=gap)
    law = [gr.LinearDashpot.from_restitution(eps, k=5e7, pair=pair) for pair in scene.pairs]
    return gr.Case(scene, law, until=gr.until.contact(0, 2))


def from_text(text, **scope):
    """A function or class as a script has it that is edited and run again."""
    here = {"__name__": "__main__", "gr": gr, "np": np, "made": made, "dataclass": dataclass} | scope
    exec(compile(text, "script.py", "exec"), here)
    return here["it"]


EDITS = [
    ("def it(gap): return made(gap, 0.7)", "def it(gap): return made(gap, 0.3)"),
    ("it = lambda gap: made(gap, 0.7)", "it = lambda gap: made(gap, 0.3)"),
    ("EPS = 0.7\ndef it(gap): return made(gap, EPS)", "EPS = 0.3\ndef it(gap): return made(gap, EPS)"),
    ("def of(gap): return made(gap, 0.7)\ndef it(gap): return of(gap)",
     "def of(gap): return made(gap, 0.3)\ndef it(gap): return of(gap)"),
    ("def of(eps):\n  def it(gap): return made(gap, eps)\n  return it\nit = of(0.7)",
     "def of(eps):\n  def it(gap): return made(gap, eps)\n  return it\nit = of(0.3)"),
    ("def it(gap, eps=0.7): return made(gap, eps)", "def it(gap, eps=0.3): return made(gap, eps)"),
    ("def it(gap):\n  a = lambda: 0.7\n  return made(gap, a())",
     "def it(gap):\n  a = lambda: 0.3\n  return made(gap, a())"),
    ("class Of:\n  def case(self, gap): return made(gap, 0.7)\nit = Of().case",
     "class Of:\n  def case(self, gap): return made(gap, 0.3)\nit = Of().case"),
]


@pytest.mark.parametrize(("first", "then"), EDITS)
def test_a_function_that_was_edited_asks_something_else(first, then, tmp_path) -> None:
    file = tmp_path / "a.nc"
    before = gr.sweep(from_text(first), GAPS, "v_rel", save=file)
    again = gr.sweep(from_text(first), GAPS, "v_rel", save=file)  # the same script once more: nothing is solved
    assert np.array_equal(before.v_rel, again.v_rel)
    with pytest.raises(ValueError, match="it holds another sweep"):
        gr.sweep(from_text(then), GAPS, "v_rel", save=file)
    assert not np.array_equal(gr.sweep(from_text(then), GAPS, "v_rel").v_rel, before.v_rel)


LAW = """
{frozen}class Own:
    k = {k}
    def force(self, xi, xi_dot, pair): return self.k * xi + 50.0 * xi_dot
scene = gr.Scene([1.0, 1.0, 1.0], [0.01] * 3, [1e-3] * 2, [1.0, 0.0, 0.0])
it = gr.Case(scene, Own(), t_end=0.05)
"""


@pytest.mark.parametrize("frozen", ["", "@dataclass(frozen=True)\n"])
def test_a_law_is_its_code_and_not_its_address(frozen, tmp_path) -> None:
    file = tmp_path / "a.nc"
    soft, same, stiff = (from_text(LAW.format(frozen=frozen, k=k)) for k in (5e5, 5e5, 5e6))
    before = gr.sweep(soft, GAPS, "duration", save=file)
    assert np.array_equal(gr.sweep(same, GAPS, "duration", save=file).duration, before.duration)
    with pytest.raises(ValueError, match="it holds another sweep"):
        gr.sweep(stiff, GAPS, "duration", save=file)


def test_a_result_is_its_code_and_an_array_all_its_entries(tmp_path) -> None:
    one, two = from_text("def it(case): return 1.0"), from_text("def it(case): return 2.0")
    gr.sweep("three-balls", GAPS, one, save=tmp_path / "a.nc")
    with pytest.raises(ValueError, match="it holds another sweep"):
        gr.sweep("three-balls", GAPS, two, save=tmp_path / "a.nc")
    still = np.zeros(1200)
    moved = still.copy()
    moved[600] = 1.0
    assert identity(still) != identity(moved)
    assert identity([partial(made, eps=0.7)]) != identity([partial(made, eps=0.3)])


def test_what_holds_itself_or_is_met_often_is_read_once() -> None:
    loop: list = [1.0]
    loop.append(loop)
    assert identity(loop) == [1.0, "itself"]
    text = "def f0(x): return x\n" + "".join(
        f"def f{i}(x): return f{i - 1}(x) + f{max(i - 2, 0)}(x)\n" for i in range(1, 60)) + "it = f59"
    assert len(str(identity(from_text(text)))) < 20_000  # and not 2^59 times as much
    assert identity(gr.compare) == "granular.comparison.run.compare"
    assert identity(np.random.default_rng(1)) == identity(np.random.default_rng(1))
    assert identity(np.random.default_rng(1)) != identity(np.random.default_rng(2))


def test_an_interruption_before_the_first_answer_leaves_no_file(tmp_path) -> None:
    text = "def it(gap):\n  if STOPS: raise KeyboardInterrupt\n  return made(gap)"
    with pytest.raises(KeyboardInterrupt):
        gr.sweep(from_text(text, STOPS=True), GAPS, "v_rel", save=tmp_path / "a.nc")
    assert not list(tmp_path.iterdir())


def test_a_refused_sweep_is_refused_again(tmp_path) -> None:
    for _ in range(2):
        with pytest.raises(ValueError, match=r"restitution is 1\.5"):
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
    (counted, {"save": "none/a.nc"}, r"a\.nc: there is no directory"),
    (lambda case: counted(case), {"save": "a.nc"}, "'<lambda>': what is saved needs a name"),
    (named("gap"), {}, "'gap': the data set has that name already"),
    (named("status"), {}, "'status': the data set has that name already"),
    ([named("one"), named("one")], {}, "'one': the data set has that name already"),
    (named(""), {}, "a function with a name is needed"),
    ("contacts", {"refine": "law", "over": {"law": ["Hertz", "TsujiHertz"]}}, "numbers are needed"),
])
def test_nothing_is_solved_in_vain(result, options, sentence, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    SOLVED.clear()
    with pytest.raises((TypeError, ValueError), match=sentence):
        gr.sweep("three-balls", options.pop("over", GAPS), result, **options)
    assert SOLVED == []
    assert list(tmp_path.iterdir()) == []


def test_a_result_that_is_no_number_is_told() -> None:
    with pytest.raises(TypeError, match=r"result 'wide' is array.*: a single number is needed"):
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
