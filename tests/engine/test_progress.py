"""One signature of ``on_progress`` for all that takes long: how far it has come, and how many things are done."""

import pytest

import granular as gr
from granular._engine import progress

GAS, LAW, RULE = gr.scenes.gas(20), gr.LinearDashpot(1e4, 1.0), gr.ConstantRestitution(0.99)
CRADLE, STEEL = gr.scenes.newtons_cradle(2), gr.Hertz(1e9)
END = {"until": gr.until.separated()}
HARD, SOFT = gr.edmd.simulate(GAS, RULE, max_events=10), gr.md.simulate(GAS, LAW, t_end=0.1)

VERBS = {
    "edmd": lambda **told: gr.edmd.simulate(GAS, RULE, max_events=20_000, log=False, **told),
    "located": lambda **told: gr.md.simulate(GAS, LAW, t_end=1.0, **told),
    "fixed": lambda **told: gr.md.simulate(GAS, LAW, t_end=1.0, dt=1e-3, **told),
    "edmd resumed": lambda **told: gr.edmd.resume(HARD, max_events=20_000, log=False, **told),
    "located resumed": lambda **told: gr.md.resume(SOFT, t_end=0.3, **told),
    "compare": lambda **told: gr.compare(GAS, LAW, t_end=1.0, **told),
    "threshold": lambda **told: gr.threshold("three-balls", between=(1e-2, 2e-2), points=2, **told),
    "sweep": lambda **told: gr.sweep("three-balls", {"gap": [1e-5, 1e-4]}, **told),
    "frontier": lambda **told: gr.frontier(CRADLE, STEEL, **END, methods=["located"], repeats=1, **told),
    "stability": lambda **told: gr.stability(gr.Case(CRADLE, STEEL, **END), "mass", "located", **told),
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_tells_how_far_it_is_and_how_many_things_are_done(verb):
    told = []
    VERBS[verb](on_progress=lambda reached, count: told.append((reached, count)))
    assert told
    assert all(type(reached) is float and type(count) is int for reached, count in told)
    if verb != "compare":  # two runs, one after the other
        assert told == sorted(told)
        assert [count for _, count in told] == sorted(count for _, count in told)
    if verb in ("sweep", "threshold", "frontier", "stability"):
        assert told[-1][0] == 1.0
        assert 0.0 < told[0][0] <= 1.0


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_function_is_refused_at_once(verb):
    with pytest.raises(TypeError, match="`on_progress` must be a function or None, got 3"):
        VERBS[verb](on_progress=3)


@pytest.mark.parametrize("verb", VERBS)
def test_progress_is_true_or_false(verb):
    with pytest.raises(TypeError, match="`progress` must be True or False, got 1"):
        VERBS[verb](progress=1)


@pytest.mark.parametrize("verb", VERBS)
def test_function_of_other_arguments_is_refused_at_once(verb):
    words = r"`on_progress` must be a function with the arguments \(reached, count\), got "
    with pytest.raises(TypeError, match=words + r"\(reached\)\."):
        VERBS[verb](on_progress=lambda reached: None)
    with pytest.raises(TypeError, match=words + r"\(count, reached\)\."):
        VERBS[verb](on_progress=lambda count, reached: None)


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_shows_how_far_it_is(verb, monkeypatch, capsys):
    monkeypatch.setattr(progress, "LINE_INTERVAL", 0.0)
    told = []
    VERBS[verb](on_progress=lambda reached, count: told.append((reached, count)), progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == len(told) > 0
    assert all(f"{count} " in line for line, (_, count) in zip(lines, told, strict=True))
