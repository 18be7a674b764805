"""Misuse of what is made of many runs, or reads them: one sentence each, and nothing that was not asked for."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import binary, cases, measures
from granular.studies.frontier_methods import contacts_of
from granular.studies.reference import Reference

SCENE = gr.scenes.three_balls(gap=1e-3)
LAW = gr.LinearDashpot.from_restitution(0.7, 5e7, SCENE.pairs[0])
END = {"until": gr.until.contact(0, 2)}
LINE = gr.Scene([1.0, 2.0], [0.1, 0.1], [0.1], [1.0, 0.0])
HARD = gr.edmd.simulate(LINE, gr.ConstantRestitution(0.5), t_end=1.0)
GAP = {"gap": (1e-3, 1e-5)}
A_RUN = "must be a granular.Trajectory, got 3."


def ask(function, **options):
    return lambda: function("three-balls", **options)


def nothing(gap=1.0):
    """A function that forgets to return."""


def ensemble(vary=GAP, **options):
    return lambda: gr.ensemble("three-balls", 2, vary, **options)


MISUSE = {
    **{f"{name} of a number": (lambda name=name: getattr(measures, name)(3), A_RUN)
       for name in measures.__all__ if name not in ("Overlap", "groups", "impact_velocities")},
    "groups of a number": (lambda: measures.groups(3, (LAW,), 1.0),
        "`scene` must be a granular.Scene, got 3."),
    "the second run is none": (lambda: measures.before_the_end(HARD, hard=3), "`hard` " + A_RUN),
    "section without walls": (lambda: measures.section(HARD),
        "`run` must be of a scene with a wall, got Scene(2 balls)."),
    "case of a number": (lambda: cases.Case(3, LAW),
        "`scene` must be a granular.Scene, got 3."),
    "options are a number": (lambda: cases.Case(SCENE, LAW, run=3),
        "`run` must be a mapping of options to values, got 3."),
    "options of a ready-made case": (lambda: cases.make("gas", run=3),
        "`run` must be a mapping of options to values, got 3."),
    "options of a sweep": (ask(gr.sweep, over="gap=1e-4,1e-3", run=3),
        "`run` must be a mapping of options to values, got 3."),
    "no option": (ask(gr.sweep, over="gap=1e-4,1e-3", run={"enginee": "plain"}),
                  "unknown option enginee; did you mean engine?"),
    "no option of a case": (lambda: cases.make("gas", run={"t_end": 1.0}),
        "unknown option t_end; available: collapse, disturbed, dt, elastic_below, engine, log, max_events, "
        "max_steps, merge_below, method, samples, seed, t_start, tc, ties, tol, watch."),
    "no option of a threshold": (ask(gr.threshold, run={"tool": 1e-9}), "unknown option tool; did you mean tol?"),
    "no parameter": (ask(gr.threshold, over="gaap"), "three-balls has no parameter `gaap`; did you mean `gap`?"),
    "parameter is a number": (ask(gr.threshold, over=3),
        "`over` must be the name of one parameter, such as 'gap', got 3."),
    "choice is an array": (lambda: gr.edmd.simulate(LINE, gr.ConstantRestitution(0.5), t_end=1.0, ties=np.ones(2)),
                           "`ties` must be one of left, right, random, newton, poisson, reflect, got array([1., 1.])."),
    "method is an array": (lambda: gr.md.simulate(SCENE, LAW, t_end=1.0, method=np.ones(2)),
        "`method` must be one of located, verlet, symplectic-euler, rk4, gear5, got array([1., 1.])."),
    "rule of a scene that is none": (lambda: gr.restitution_of(LAW, 3),
        "`scene` must be a granular.Scene, such as granular.scenes.three_balls(), got 3."),
    "rule of other laws": (lambda: gr.edmd.simulate(LINE, gr.restitution_of([LAW, LAW]), t_end=1.0),
                           "The length of `laws` must be 1 (the number of pairs), got 2"),
    "ball filled with words": (lambda: gr.balls.Ball(1.0, 0.1, 1e-3, 0.7, filled="no"),
        "`filled` must be True or False, got 'no'."),
    "law without fields": (lambda: binary.with_restitution(cases, 0.5, SCENE.pairs[0]),
        "`law` must be an object with force(self, xi, xi_dot, pair), got <module 'granular.cases' from "),
    "field is a list": (lambda: binary.with_restitution(LAW, 0.5, SCENE.pairs[0], field=[]),
        "`field` must be a field of LinearDashpot, got []. Name the damping of the law."),
    "run to go on from": (lambda: gr.md.resume(3, t_end=1.0), "`trajectory` " + A_RUN),
    "hard run to go on from": (lambda: gr.edmd.resume(3, t_end=1.0), "`trajectory` " + A_RUN),
    "section of a word": (lambda: measures.section(HARD, "x"), "`pair` must be a single number, got 'x'"),
    "case to write": (lambda: cases.dumps(3), "`case` must be a granular.Case, got 3"),
    "file is a number": (lambda: cases.load(3), "`path` must be the name of a file, got 3"),
    "no balls": (lambda: gr.scenes.ball_stack(masses=[]),
        "`masses` must be an array of at least one mass, got an empty array."),
    "walls are a word": (lambda: gr.scenes.gas(walls="no"), "`walls` must be True or False, got 'no'"),
    "engine is an array": (lambda: gr.edmd.simulate(LINE, gr.ConstantRestitution(0.5), t_end=1.0, engine=np.ones(2)),
                           "`engine` must be one of auto, sorted, compiled, got array([1., 1.])."),
    "function without a case": (lambda: gr.sweep(nothing, "gap=1,2"),
        "The return value of nothing must be a granular.Case, got None."),
    "function of other names": (lambda: gr.sweep(nothing, "gaap=1,2"),
        "nothing has no parameter `gaap`; did you mean `gap`?"),
    "draws of a number": (ensemble(3), "`vary` must be a mapping of parameters to their distributions, got 3"),
    "draws of no name": (ensemble({3: (1.0, 1.0)}), "A parameter must be a name such as gap or radii[0], got 3."),
    "gap is no seed": (ensemble("gap"),
        "`vary['gap']` must not be None, because gap is not an integer seed. Give (mean, sd), a function of the "
        "generator, or None for a seed."),
    "spread below 0": (ensemble({"gap": (1e-3, -1.0)}),
        "The standard deviation of gap must be a finite number of at least 0, got -1.0."),
    "mean is nan": (ensemble({"gap": (math.nan, 1.0)}), "`vary['gap'][0]` must be a finite number, got nan."),
    "way without a generator": (ensemble({"gap": lambda: 1e-3}),
        "`vary['gap']` must be a function with the argument (generator), got ()."),
    "margin below 0": (ensemble(margin={"energy_left": -1.0}),
        "The margin of energy_left must be a finite number of at least 0, got -1.0."),
    "margin is a word": (ensemble(margin="wide"), "`margin` must be a single number, got 'wide'"),
    "independent is a word": (ensemble(independent="no"), "`independent` must be True or False, got 'no'"),
    "results are a number": (ensemble(results=3),
        "`results` must be a name or a function of a run, or several, got 3."),
    "a result is a number": (ask(gr.sweep, over="gap=1e-4,1e-3", results=[3]),
        "Every entry of `results` must be a name or a function, got 3."),
    "outcomes are a number": (ask(gr.sensitivity, results=3),
        "`results` must be a name such as 'v_rel', or several, got 3."),
    "names are a number": (ask(gr.sensitivity, over=3), "`over` must be a name, or several, got 3."),
    "methods are a number": (ask(gr.stability, methods=3),
        "`methods` must be one or more of located, verlet, symplectic-euler, rk4, gear5, got 3."),
    "no methods": (ask(gr.stability, methods=()),
        "`methods` must be one or more of located, verlet, symplectic-euler, rk4, gear5, got an empty list."),
    "axes are a number": (ask(gr.stability, axes=3),
        "`axes` must be one or more of stiffness, gap, damping, mass, got 3."),
    "peers are nothing": (lambda: gr.frontier(SCENE, LAW, **END, methods=[]),
        "`methods` must be one or more of located, verlet, symplectic-euler, rk4, gear5, edmd, dop853+events, "
        "lsoda+events, radau+events, dop853, lsoda, radau, got an empty list."),
    "reference is a number": (lambda: gr.frontier(SCENE, LAW, **END, reference=3),
        "`reference` must be a Reference, as granular.studies.reference.solve returns, got 3."),
}


@pytest.mark.parametrize("case", MISUSE)
def test_misuse_is_one_sentence(case):
    call, sentence = MISUSE[case]
    with pytest.raises((TypeError, ValueError), match=re.escape(sentence)) as caught:
        call()
    assert str(caught.value)[-1] in ".?"


def test_the_reference_of_another_scene_law_or_end_is_refused():
    def solved(scene=SCENE, law=LAW, **end):
        run = gr.md.simulate(scene, law, **(end or END))
        return Reference(contacts_of(run), float(run.time[-1]), run.status.name, "itself")

    for other in (solved(SCENE.replace(gap=[0.49, 1e-3])), solved(law=replace(LAW, gamma=9.0)), solved(t_end=0.35)):
        with pytest.raises(ValueError, match="`reference` must belong to this scene, law and end, with 2 contacts "
                                             r"until 0\.766421 s, got \d contacts until 0\.\d+ s\."):
            gr.frontier(SCENE, LAW, **END, methods="edmd", reference=other)
    assert gr.frontier(SCENE, LAW, **END, methods="edmd", repeats=1, reference=solved()).methods == ("edmd",)


@pytest.mark.parametrize("engine", ["edmd", "md"])
def test_a_saved_run_without_its_log_is_known_also_without_the_mark(tmp_path, engine):
    """As earlier versions saved it; one that only went on from another has a log, if an empty one."""
    case = cases.make("three-balls", t_end=0.6)
    for log in (False, True):
        run = case.simulate(engine, log=log, until=None)
        replace(run, stats={name: x for name, x in run.stats.items() if name != "log"}).save(tmp_path / "run.npz")
        assert gr.Trajectory.load(tmp_path / "run.npz").stats.get("log", True) is log
    on = getattr(gr, engine).resume(run, t_end=0.6 + 1e-9)
    assert len(on.contacts) == 0
    on.save(tmp_path / "run.npz")
    assert "log" not in gr.Trajectory.load(tmp_path / "run.npz").stats
