"""Cost of an answer in function calls of this package, which does not depend on the load of the machine."""

import pytest

import granular as gr
from granular.studies.sweeps.results import RESULTS
from tests.located.test_costs import calls


def scenes():
    """Name, scene, laws and end of four scenes of different kinds."""
    def dashpots(scene, eps, k):
        return [gr.LinearDashpot.from_restitution(eps, k=k, pair=pair) for pair in scene.pairs]

    drop, cradle, stack, gas = gr.scenes.three_balls(gap=1e-4), gr.scenes.newtons_cradle(5), gr.scenes.ball_stack(4), (
        gr.scenes.gas(20))
    yield pytest.param(drop, dashpots(drop, 0.7, 5e7), {"until": gr.until.contact(pair=0, nth=2)}, id="drop")
    yield pytest.param(cradle, gr.Hertz(1e10), {"until": gr.until.separated()}, id="cradle")
    yield pytest.param(stack, dashpots(stack, 0.9, 5e7), {"until": gr.until.separated()}, id="stack")
    yield pytest.param(gas, dashpots(gas, 0.9, 1e8), {"t_end": 0.5}, id="gas")


@pytest.mark.parametrize(("scene", "law", "end"), list(scenes()))
def test_an_answer_costs_at_most_three_and_a_half_times_its_runs(scene, law, end):
    """The cost includes a hard run from shifted gaps, and runs under other tie rules for touching balls. The factor
    was 5.1 to 6.5 before results were cached in their runs."""
    pytest.importorskip("numba")
    rule = gr.compare(scene, law, engine="compiled", **end).rule
    hard = calls(lambda: gr.edmd.simulate(scene, rule, **end))
    soft = calls(lambda: gr.md.simulate(scene, law, engine="compiled", **end))
    answer = calls(lambda: gr.compare(scene, law, engine="compiled", **end).answer)
    assert hard > 100
    assert soft > 50
    assert answer <= 3.5 * (hard + soft)


def test_a_measure_costs_no_other_measure(monkeypatch):
    """A map of the shared impulse does not require a second hard run, unlike the measure "predictability"."""
    runs = []
    simulate = gr.edmd.simulate
    monkeypatch.setattr("granular.comparison.answer.edmd.simulate", lambda *a, **o: runs.append(1) or simulate(*a, **o))
    for name, expected in (("shared_impulse", 0), ("error", 0), ("crowding", 0), ("predictability", 1), ("answer", 1)):
        runs.clear()
        gr.sweep("three-balls", {"gap": [1e-3]}, name)
        assert len(runs) - 1 == expected, name  # without the hard run of the comparison itself


def test_answers_of_a_sweep_are_those_of_comparisons():
    gaps = [1e-6, 1e-4, 1e-2]
    data = gr.sweep("three-balls", {"gap": gaps}, ("answer", "error", "hard_status"))
    codes = dict(zip(data["answer"].attrs["flag_values"], data["answer"].attrs["flag_meanings"].split(), strict=True))
    cases = [gr.cases.make("three-balls", gap=gap) for gap in gaps]
    reports = [gr.compare(case.scene, case.law, until=case.until) for case in cases]
    assert [codes[code] for code in data["answer"].values.tolist()] == [report.answer.name for report in reports]
    assert data["error"].values.tolist() == [report.error for report in reports]
    assert set(RESULTS["answer"].meanings.values()) == {"not_run", *(answer.name for answer in gr.Answer)}
    assert data["hard_status"].attrs["flag_meanings"] == data["status"].attrs["flag_meanings"]
