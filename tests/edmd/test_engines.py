"""The compiled queue gives the bits of the reference queue, and engines are chosen as said."""

import dataclasses
import math
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import granular as gr
from granular import edmd
from granular._engine.kernels import fitted
from granular.edmd import queue_choice
from granular.edmd.compiled_queue import loop
from granular.laws.rules import ConstantRestitution
from granular.run.trajectory import Status
from granular.scene import Scene
from tests.helpers.scenes_at_random import HARD, gas, scenes

pytest.importorskip("numba")


def same(a, b):
    assert a.status is b.status
    assert a.contacts.tobytes() == b.contacts.tobytes()
    assert a.time.tobytes() == b.time.tobytes()
    for name in ("position", "velocity", "gap"):
        assert getattr(a, name).tobytes() == getattr(b, name).tobytes(), name
    same_state(a, b)


def same_state(a, b):
    assert a.state.keys() == b.state.keys()
    for key, value in a.state.items():
        assert np.array_equal(value, b.state[key], equal_nan=not isinstance(value, str)), key


@pytest.mark.rotating
@given(
    scene=scenes(balls=(1, 30), walls=(0.5, 0.4, 0.3), gravity=(0.0, 1.0, 9.81), gaps=(*HARD, "uneven"), size=1e-2),
    seed=st.integers(0, 10**6), eps=st.sampled_from([1.0, 0.9, 0.5, "mixed"]),
    ties=st.sampled_from(["left", "right", "random"]),
    extra=st.sampled_from([{}, {}, {"tc": 1e-2}, {"elastic_below": 0.05}, {"collapse": "merge"}]),
)
@settings(max_examples=100, deadline=None)
def test_both_queues_give_the_same_bits(scene, seed, eps, ties, extra) -> None:
    values = [(0.5, 0.9, 1.0)[c % 3] for c in range(scene.n - 1)] if eps == "mixed" else eps
    rule, options = ConstantRestitution(values), {"ties": ties, "seed": seed, "max_events": 400, **extra}
    plain = edmd.simulate(scene, rule, t_end=3.0, samples=5, engine="sorted", **options)
    fast = edmd.simulate(scene, rule, t_end=3.0, samples=5, engine="compiled", **options)
    same(plain, fast)
    if plain.status is Status.max_events:
        crossed = ((plain, "compiled"), (fast, "sorted"))
        same(*(edmd.resume(run, t_end=3.0, max_events=100, engine=e) for run, e in crossed))
    for engines in (("sorted", "compiled"), ("compiled", "sorted")):
        part = edmd.simulate(scene, rule, t_end=1.3, engine=engines[0], **options)
        if part.status is Status.time:
            left = 400 - part.stats["events"]
            rest = edmd.resume(part, t_end=3.0, max_events=left, engine=engines[1])
            whole = edmd.simulate(scene, rule, t_end=3.0, engine="sorted", **options)
            assert np.concatenate([part.contacts, rest.contacts]).tobytes() == whole.contacts.tobytes()
            same_state(rest, whole)


@pytest.mark.rotating
@pytest.mark.parametrize("eps", [0.0, 0.0717, 0.0719, 0.3])
def test_collapses_and_sticking_are_the_same(eps) -> None:
    for n, g in ((3, 0.0), (6, 0.0), (20, 1.0)):
        scene = Scene([math.inf] * (g > 0) + [1.0] * n, np.zeros(n + (g > 0)), np.ones(n - (g == 0)),
                      [0.0] * (g > 0) + np.linspace(1, -1, n).tolist(), g)
        plain, fast = (edmd.simulate(scene, ConstantRestitution(eps), engine=e) for e in ("sorted", "compiled"))
        same(plain, fast)
        assert plain.message == fast.message


@pytest.mark.rotating
def test_auto_takes_the_compiled_queue_when_it_pays() -> None:
    scene = gas(1, 200, 3.0)
    one = ConstantRestitution(1.0)
    short = {"max_events": 120_000, "log": False}
    a, b = (edmd.simulate(scene, one, engine=engine, samples=[1.0, 9.0], **short) for engine in ("auto", "sorted"))
    assert (a.stats["engine"], b.stats["engine"]) == ("compiled", "sorted")
    assert a.velocity.tobytes() == b.velocity.tobytes()
    assert a.state["gap"].tobytes() == b.state["gap"].tobytes()
    assert edmd.simulate(scene, one, max_events=100).stats["engine"] == "sorted"
    long = edmd.simulate(scene, one, t_end=2000.0, log=False)
    assert long.stats["engine"] == "compiled"
    assert long.energy()[-1] == pytest.approx(long.energy()[0], rel=1e-13)


def test_auto_asks_for_the_machine_code_of_its_kind_of_scene(monkeypatch) -> None:
    """That of rings, pendula, moving and thermal walls is another one than that of plain scenes."""
    asked = []
    monkeypatch.setattr(queue_choice, "LOADING_WORK", 500)
    monkeypatch.setattr(queue_choice, "is_worthwhile", lambda function, *_, **__: asked.append(function) or False)
    shaken = dataclasses.replace(gas(1, 20), floor=gr.walls.Sine(1e-3, 50.0))
    hung = gr.scenes.pendulum_cradle(20)
    for of in (gr.scenes.ring_gas(20, 20.0), gr.scenes.heated_gas(20, 20.0), hung, shaken, gas(1, 20)):
        edmd.simulate(of, ConstantRestitution(1.0), max_events=600)
        assert asked.pop() is fitted(loop, **of._flags)
    assert fitted(loop, RING=True) is not loop


def test_what_does_not_compile_says_so() -> None:
    scene = gas(1, 3)
    with pytest.raises(ValueError, match="`engine` must be 'sorted' or 'auto' here, got 'compiled': every rule "
                                         r"must be a ConstantRestitution\."):
        edmd.simulate(scene, lambda v, pair: 0.5, engine="compiled")
    with pytest.raises(ValueError, match="`engine` must be 'sorted' or 'auto' here, got 'compiled': "
                                         r"ties='poisson' runs only interpreted\."):
        edmd.simulate(scene, ConstantRestitution(0.5), ties="poisson", engine="compiled")


@pytest.mark.rotating
def test_without_numba_the_reference_runs_and_compiled_says_what_to_install(monkeypatch) -> None:
    scene = gas(1, 200, 3.0)
    monkeypatch.setitem(sys.modules, "numba", None)
    run = edmd.simulate(scene, ConstantRestitution(1.0), t_end=1e6, max_events=110_000, log=False)
    assert run.stats["engine"] == "sorted"
    with pytest.raises(ImportError, match="`engine` cannot be 'compiled': numba is not installed; run pip install "
                                          r"'granular-collisions\[fast\]'\."):
        edmd.simulate(scene, ConstantRestitution(1.0), t_end=1.0, engine="compiled")


@pytest.mark.rotating
def test_numba_told_not_to_compile_is_as_if_it_were_not_there() -> None:
    code = (
        "import granular as gr\n"
        "scene, rule = gr.scenes.column(), gr.ConstantRestitution(0.9)\n"
        "print(gr.edmd.simulate(scene, rule).stats['engine'])\n"
        "law = gr.LinearDashpot(1e6, 1.0)\n"
        "print(gr.md.simulate(scene, law, t_end=0.01).status.name)\n"
        "for run in (lambda: gr.edmd.simulate(scene, rule, engine='compiled'),\n"
        "            lambda: gr.md.simulate(scene, law, t_end=0.01, engine='compiled')):\n"
        "    try:\n"
        "        run()\n"
        "    except ImportError as why:\n"
        "        print(why)\n"
    )
    for before, variable in (("", {"NUMBA_DISABLE_JIT": "1"}), ("import numba; numba.config.DISABLE_JIT = 1\n", {})):
        if before:
            pytest.importorskip("numba")
        out = subprocess.run(
            [sys.executable, "-c", before + code], capture_output=True, text=True, check=True, env=os.environ | variable
        )
        why = "`engine` cannot be 'compiled': NUMBA_DISABLE_JIT is set, so numba compiles nothing; unset it."
        assert out.stdout.splitlines() == ["sorted", "time", why, why]
