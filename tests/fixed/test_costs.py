"""What a fixed-step run pays for, in counts: laws asked at its end, rows written, looks on the way."""

import math
from functools import partial

import numpy as np
import pytest

import granular as gr
from granular.laws.contact_law import PairLaw
from granular.laws.kinds import checked
from granular.md.fixed import run as fixed
from granular.md.fixed.integrators import INTEGRATORS
from granular.md.fixed.stepper import Stepper
from granular.md.fixed.window import DEEPEST, SHARED

pytestmark = pytest.mark.core
verlet = partial(gr.md.simulate, method="verlet", dt=1e-4, engine="plain")


def compressed(n):
    """Return equal balls between two walls, overlapping by different lengths."""
    v, gap = np.zeros(n), -1e-3 * np.linspace(1.0, 2.0, n - 1)
    return gr.Scene([math.inf, *[1.0] * (n - 2), math.inf], [0.0, *[0.5] * (n - 2), 0.0], gap, v)


def laws_made(n, law, patch):
    """Return how many laws of a pair are made for a run of `n` balls, its start and its end included."""
    made, make = [], PairLaw.__init__

    def counted(self, *given, **named):
        made.append(None)
        make(self, *given, **named)

    scene = compressed(n)
    with patch.context() as here:
        here.setattr(PairLaw, "__init__", counted)
        verlet(scene, law, t_end=2e-4, log=False)
    return len(made)


@pytest.mark.parametrize("law", [gr.Hertz(1e6), gr.LinearDashpot(1e5, 3.0), gr.ViscoelasticHertz(1e6, 3.0)])
def test_as_many_laws_are_made_for_a_thousand_balls_as_for_ten(law, monkeypatch):
    """Pairs of equal sizes under one law are one kind, however differently they overlap."""
    assert laws_made(1000, law, monkeypatch) == laws_made(10, law, monkeypatch) > 0


@pytest.mark.parametrize("method", ["verlet", "symplectic-euler"])
def test_a_run_without_log_writes_no_row_of_a_log(method):
    """Those of peaks and of the state a step ago stay as they are; what is judged at the end is noted all the same."""
    of_log = ("xi_max", "force_max", "impulse", "was_xi", "was_v")
    scene, untouched = compressed(5), {}
    for logged in (False, True):
        laws = checked(gr.Hertz(1e6), scene)
        stepper = Stepper(scene, laws, INTEGRATORS[method], 1e-4, (-1, 0), logged, False)
        window = stepper.work.window
        for name in ("was_xi", "was_v"):
            getattr(window, name)[:] = [math.pi] * len(window.v)
        stepper.march(0, 10, 1 << 60)
        untouched[logged] = {name for name in of_log if set(getattr(window, name)[1:-1]) <= {0.0, math.pi}}
        assert (stepper.pairs(DEEPEST) > 0.0).all()
        assert (stepper.pairs(SHARED) > 0.0).all()
    # Verlet keeps velocities of a step ago only where a contact begins or ends
    assert untouched == {False: set(of_log), True: {"was_v"} if method == "verlet" else set()}


@pytest.mark.parametrize(("law", "seen"), [(gr.Hertz(1e6), False), (gr.ViscoelasticHertz(1e6, 3.0), True)])
def test_velocities_are_predicted_only_for_forces_that_see_them(law, seen):
    scene = compressed(5)
    stepper = Stepper(scene, checked(law, scene), INTEGRATORS["verlet"], 1e-4, (-1, 0), False, False)
    guess = stepper.work.window.guess
    guess[:] = [math.pi] * len(guess)
    stepper.march(0, 10, 1 << 60)
    assert (set(guess) != {math.pi}) is seen


def test_looks_on_the_way_are_a_matter_of_time_not_of_steps(monkeypatch):
    """Where steps take no time, every stretch between two looks is twice as long as the one before."""
    looks, march = [], Stepper.march

    def counted(self, k, steps, room):
        looks.append(steps)
        return march(self, k, steps, room)

    monkeypatch.setattr(Stepper, "march", counted)
    monkeypatch.setattr(fixed, "process_time", lambda: 0.0)
    verlet(compressed(65), gr.Hertz(1e6), t_end=0.30005, log=False)
    assert looks == [128, 256, 512, 1024, 3000 - 128 - 256 - 512 - 1024]


@pytest.mark.parametrize("chunk", [1, 700, 1 << 20])
def test_as_many_steps_are_taken_as_are_allowed_wherever_one_looks(chunk, monkeypatch):
    monkeypatch.setattr(fixed, "FIRST_CHUNK_PAIR_STEPS", chunk)
    run = verlet(compressed(5), gr.Hertz(1e6), t_end=1.0, max_steps=1234)
    assert (run.status, run.stats["steps"]) == (gr.Status.max_events, 1234)
