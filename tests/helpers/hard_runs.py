"""Runs of hard spheres by the reference queue: what their account leaves over, that they go on and follow the twin."""

import math

import mpmath as mp
import numpy as np
import pytest

import granular as gr
from granular._engine.kernels import have_numba
from tests.helpers import hard_twin

INF = math.inf
QUEUES = pytest.mark.parametrize("engine", [
    "sorted", pytest.param("compiled", marks=[pytest.mark.soak, pytest.mark.skipif(not have_numba(), reason="numba")])])
"""To compile what these scenes need takes half a minute for each kind."""


def run(scene, eps=1.0, **options):
    """A run with one coefficient of restitution, by the reference queue."""
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"engine": "sorted"} | options)


def remainder(result):
    """What the account leaves over, at most, in units of the energies that came, went, and are added up."""
    account, ball = result.account(), ~result.scene.is_wall
    rest = account["energy"] - account["work"].sum(axis=1) - account["heat"].sum(axis=1) + account["dissipated"]
    most = sum(np.abs(account[name]).max() for name in ("energy", "work", "heat", "dissipated"))
    moving = 0.5 * result.velocity[:, ball] ** 2 @ result.scene.mass[ball]  # by height it is paid back
    return np.abs(rest - rest[0]).max() / (most + moving.max())


def same(a, b):
    """Raise where two runs differ by a bit."""
    for name in ("time", "position", "velocity", "gap", "ledger"):
        one, other = getattr(a, name), getattr(b, name)
        assert (one is None) == (other is None)
        assert one is None or np.array_equal(one, other), name
    assert a.contacts.tobytes() == b.contacts.tobytes()
    assert a.message == b.message


def goes_on(scene, eps, engine, tmp_path, asked, **options):
    """A run, and the rest of it from a file of its first half; raise where they, or the queues, differ by a bit."""
    whole = run(scene, eps, **options, **asked)
    if engine != "sorted":
        same(whole, run(scene, eps, **options, **asked, engine=engine))
    run(scene, eps, **options, max_events=len(whole.contacts) // 2).save(tmp_path / "half.npz")
    half = gr.Trajectory.load(tmp_path / "half.npz")
    left = asked["max_events"] - len(half.contacts)
    rest = gr.edmd.resume(half, t_end=asked["t_end"], max_events=left, engine=engine)
    assert rest.contacts.tobytes() == whole.contacts[len(half.contacts) :].tobytes()
    for name in ("velocity", "gap", *["ledger"] * (whole.ledger is not None)):
        assert getattr(rest, name)[-1].tobytes() == getattr(whole, name)[-1].tobytes(), name
    return whole, rest


def follows_the_twin(scene, eps, result, most):
    """Raise where a run does not make the collisions of the twin, in its order, at its times and speeds."""
    with mp.workdps(30):
        late = 1e-6 * (result.status is gr.Status.max_events)
        rows = hard_twin.events(scene, eps, float(result.time[-1]) + late, most, float(result.time[0]))
    log = result.contacts
    assert [pair for _, pair, _ in rows] == log["pair"].tolist()
    time, speed = (np.array([float(row[k]) for row in rows]) for k in (0, 2))
    assert np.abs(time - log["t_begin"]).max(initial=0.0) < 1e-8
    assert np.abs(speed - (log["v_in"][:, 0] - log["v_in"][:, 1])).max(initial=0.0) < 1e-6


def loss(result):
    """Share of the energy that is left."""
    return result.energy()[-1] / result.energy()[0]
