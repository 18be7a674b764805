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
A_RUN = "a granular.Trajectory is needed."


def ask(function, **options):
    return lambda: function("three-balls", **options)


def nothing(gap=1.0):
    """A function that forgets to return."""


def ensemble(vary=GAP, **options):
    return lambda: gr.ensemble("three-balls", 2, vary, **options)


MISUSE = {
    **{f"{name} of a number": (lambda name=name: getattr(measures, name)(3), A_RUN)
       for name in measures.__all__ if name not in ("Overlap", "groups", "impact_velocities")},
    "groups of a number": (lambda: measures.groups(3, (LAW,), 1.0), "scene is 3: a granular.Scene is needed."),
    "the second run is none": (lambda: measures.before_the_end(HARD, hard=3), "hard is 3: " + A_RUN),
    "section without walls": (lambda: measures.section(HARD), "run is of Scene(2 balls): one with a wall is needed."),
    "case of a number": (lambda: cases.Case(3, LAW), "scene is 3: a granular.Scene is needed."),
    "options are a number": (lambda: cases.Case(SCENE, LAW, run=3), "run is 3: a mapping of options to values is"),
    "options of a ready-made case": (lambda: cases.make("gas", run=3), "run is 3: a mapping of options to values is"),
    "options of a sweep": (ask(gr.sweep, over="gap=1e-4,1e-3", run=3), "run is 3: a mapping of options to values is"),
    "no option": (ask(gr.sweep, over="gap=1e-4,1e-3", run={"enginee": "plain"}),
                  "'enginee' is no option of a run; did you mean engine?"),
    "no option of a case": (lambda: cases.make("gas", run={"t_end": 1.0}), "'t_end' is no option of a run: collapse, "),
    "no option of a threshold": (ask(gr.threshold, run={"tool": 1e-9}), "'tool' is no option of a run; did you mean"),
    "no parameter": (ask(gr.threshold, over="gaap"), "'gaap' is no parameter of three-balls; did you mean gap?"),
    "parameter is a number": (ask(gr.threshold, over=3), "over is 3: the name of one parameter, such as 'gap', is"),
    "choice is an array": (lambda: gr.edmd.simulate(LINE, gr.ConstantRestitution(0.5), t_end=1.0, ties=np.ones(2)),
                           "ties is array([1., 1.]): one of"),
    "method is an array": (lambda: gr.md.simulate(SCENE, LAW, t_end=1.0, method=np.ones(2)), "method is array([1., 1"),
    "rule of a scene that is none": (lambda: gr.restitution_of(LAW, 3), "scene is 3: a granular.Scene is needed"),
    "rule of other laws": (lambda: gr.edmd.simulate(LINE, gr.restitution_of([LAW, LAW]), t_end=1.0),
                           "length of laws is 2: 1 (the number of pairs) is needed"),
    "ball filled with words": (lambda: gr.balls.Ball(1.0, 0.1, 1e-3, 0.7, filled="no"), "filled is 'no': True or F"),
    "law without fields": (lambda: binary.with_restitution(cases, 0.5, SCENE.pairs[0]), "law is <module"),
    "field is a list": (lambda: binary.with_restitution(LAW, 0.5, SCENE.pairs[0], field=[]), "field is []: Linear"),
    "run to go on from": (lambda: gr.md.resume(3, t_end=1.0), "trajectory is 3: " + A_RUN),
    "hard run to go on from": (lambda: gr.edmd.resume(3, t_end=1.0), "trajectory is 3: " + A_RUN),
    "section of a word": (lambda: measures.section(HARD, "x"), "pair is 'x': a single number is needed."),
    "case to write": (lambda: cases.dumps(3), "case is 3: a granular.Case is needed."),
    "file is a number": (lambda: cases.load(3), "path is 3: the name of a file is needed."),
    "no balls": (lambda: gr.scenes.ball_stack(masses=[]), "masses is empty: at least one mass is needed."),
    "walls are a word": (lambda: gr.scenes.gas(walls="no"), "walls is 'no': True or False is needed."),
    "engine is an array": (lambda: gr.edmd.simulate(LINE, gr.ConstantRestitution(0.5), t_end=1.0, engine=np.ones(2)),
                           "engine is array([1., 1.]): one of"),
    "function without a case": (lambda: gr.sweep(nothing, "gap=1,2"), "what nothing returns is None: a granular.Case"),
    "function of other names": (lambda: gr.sweep(nothing, "gaap=1,2"), "'gaap' is no parameter of nothing; did you"),
    "draws of a number": (ensemble(3), "vary is 3: a mapping of parameters to their distributions is needed."),
    "draws of no name": (ensemble({3: (1.0, 1.0)}), "3 is no name of a parameter, such as gap or radii[0]."),
    "gap is no seed": (ensemble("gap"), "gap in vary is None, and no seed, which is a whole number; give (mean, sd)"),
    "spread below 0": (ensemble({"gap": (1e-3, -1.0)}), "sd of gap in vary is -1.0: a finite number of at least 0"),
    "mean is nan": (ensemble({"gap": (math.nan, 1.0)}), "gap in vary[0] is nan: a finite number is needed"),
    "way without a generator": (ensemble({"gap": lambda: 1e-3}), "gap in vary takes (): (generator) is needed."),
    "margin below 0": (ensemble(margin={"energy_left": -1.0}), "margin of energy_left is -1.0: a finite number of at"),
    "margin is a word": (ensemble(margin="wide"), "margin is 'wide': a single number is needed."),
    "independent is a word": (ensemble(independent="no"), "independent is 'no': True or False is needed."),
    "results are a number": (ensemble(results=3), "results is 3: a name or function of a run, or several, is needed."),
    "a result is a number": (ask(gr.sweep, over="gap=1e-4,1e-3", results=[3]), "an entry of results is 3: a name or f"),
    "outcomes are a number": (ask(gr.sensitivity, results=3), "results is 3: an outcome, such as 'v_rel', is needed."),
    "names are a number": (ask(gr.sensitivity, over=3), "over is 3: a name, or several, is needed."),
    "methods are a number": (ask(gr.stability, methods=3), "methods is 3: one or more of located, verlet, "),
    "no methods": (ask(gr.stability, methods=()), "methods is empty: one or more of located, verlet, "),
    "axes are a number": (ask(gr.stability, axes=3), "axes is 3: one or more of stiffness, gap, damping, mass is"),
    "peers are nothing": (lambda: gr.frontier(SCENE, LAW, **END, methods=[]), "methods is empty: one or more of loc"),
    "reference is a number": (lambda: gr.frontier(SCENE, LAW, **END, reference=3), "reference is 3: what granular.stu"),
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
        with pytest.raises(ValueError, match="that of this scene, law and end is needed, with "):
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
