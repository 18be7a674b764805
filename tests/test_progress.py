"""One signature of ``on_progress`` for all that takes long: how far it has come, and how many things are done."""

import pytest

import granular as gr

GAS, LAW, RULE = gr.scenes.gas(20), gr.LinearDashpot(1e4, 1.0), gr.ConstantRestitution(0.99)
CRADLE, STEEL = gr.scenes.newtons_cradle(2), gr.Hertz(1e9)
END = {"until": gr.until.separated()}

VERBS = {
    "edmd": lambda told: gr.edmd.simulate(GAS, RULE, max_events=20_000, log=False, on_progress=told),
    "located": lambda told: gr.md.simulate(GAS, LAW, t_end=1.0, on_progress=told),
    "fixed": lambda told: gr.md.simulate(GAS, LAW, t_end=1.0, dt=1e-3, on_progress=told),
    "compare": lambda told: gr.compare(GAS, LAW, t_end=1.0, on_progress=told),
    "sweep": lambda told: gr.sweep("three-balls", {"gap": [1e-5, 1e-4]}, on_progress=told),
    "frontier": lambda told: gr.frontier(CRADLE, STEEL, **END, methods=["located"], repeats=1, on_progress=told),
    "stability": lambda told: gr.stability(gr.Case(CRADLE, STEEL, **END), "mass", "located", on_progress=told),
}


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_tells_how_far_it_is_and_how_many_things_are_done(verb):
    told = []
    VERBS[verb](lambda reached, count: told.append((reached, count)))
    assert told
    assert all(type(reached) is float and type(count) is int for reached, count in told)
    if verb != "compare":  # two runs, one after the other
        assert told == sorted(told)
        assert [count for _, count in told] == sorted(count for _, count in told)
    if verb in ("sweep", "frontier", "stability"):
        assert told[-1][0] == 1.0
        assert 0.0 < told[0][0] <= 1.0


@pytest.mark.parametrize("verb", VERBS)
def test_what_is_no_function_is_refused_at_once(verb):
    with pytest.raises(TypeError, match="on_progress is 3: a function, or None, is needed"):
        VERBS[verb](3)


@pytest.mark.parametrize("verb", VERBS)
def test_function_of_other_arguments_is_refused_at_once(verb):
    with pytest.raises(TypeError, match=r"on_progress takes \(reached\): \(reached, count\) is needed\."):
        VERBS[verb](lambda reached: None)
    with pytest.raises(TypeError, match=r"on_progress takes \(count, reached\): \(reached, count\) is needed\."):
        VERBS[verb](lambda count, reached: None)
