"""Fixed-step methods: one source for plain and compiled, statuses, bookkeeping."""

import math
from dataclasses import dataclass
from functools import cache, partial

import numpy as np
import pytest

import granular as gr
from tests.helpers.fixed_steps import ALL, pair_scene, restitution, verlet


def three_balls(**options):
    scene = gr.scenes.three_balls(**options)
    return scene, [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=p) for p in scene.pairs]


def same_bits(one, other):
    for name in ("time", "position", "velocity", "gap", "force"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert one.contacts.tobytes() == other.contacts.tobytes()


@pytest.mark.rotating
def test_plain_and_compiled_give_the_same_bits_for_every_law():
    scene = gr.scenes.newtons_cradle(7)
    laws = [
        gr.LinearDashpot(1e6, 50.0), gr.Hertz(1e9), gr.ViscoelasticHertz(1e9, 1e5), gr.TsujiHertz(1e9, 0.1),
        gr.PowerLaw(1e9, 1.75), gr.WaltonBraun(1e6, 2e6),
    ]
    plain, compiled = (verlet(scene, laws, t_end=0.02, dt=2e-5, engine=e) for e in ("plain", "compiled"))
    assert compiled.stats["engine"] == "compiled"
    same_bits(plain, compiled)


@pytest.mark.parametrize("chunk", [500, 1 << 15])
def test_auto_goes_on_compiled_in_the_middle_of_a_run(monkeypatch, chunk):
    """Also right after a chunk in which contacts ended."""
    from granular.md.fixed import run as fixed

    monkeypatch.setattr(fixed.CompilationCost, "due", lambda self: True)
    monkeypatch.setattr(fixed, "FIRST_CHUNK_PAIR_STEPS", chunk)
    scene, law = three_balls()
    options = {"until": gr.until.contact(0, 2), "dt": 1e-7}
    auto, plain = (verlet(scene, law, engine=e, **options) for e in ("auto", "plain"))
    assert (auto.stats["engine"], plain.stats["engine"]) == ("compiled", "plain")
    same_bits(auto, plain)


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
def test_a_force_beyond_numbers_is_unstable(method):
    """Python's own powers raise where compiled ones are infinite."""

    @dataclass(frozen=True)
    class Cubic:
        k: float
        k3: float

        def force(self, xi, xi_dot, pair):
            return self.k * xi + self.k3 * xi**3

    scene = gr.Scene([math.inf, 0.01, 0.01, math.inf], [0.0, 0.5, 0.5, 0.0], [-1e-3] * 3, [0.0, 1.0, -1.0, 0.0])
    run = gr.md.simulate(scene, Cubic(1e5, 1e8), method=method, dt=5e-4, t_end=1.0)
    assert run.status is gr.Status.unstable


def test_a_law_that_does_not_compile_runs_plain_and_says_why(monkeypatch):
    from granular.md.fixed import run as fixed

    @dataclass(frozen=True)
    class Wordy:
        k: float
        name: str

        def force(self, xi, xi_dot, pair):
            return self.k * max(0.0, xi)

    monkeypatch.setattr(fixed.CompilationCost, "due", lambda self: True)
    monkeypatch.setattr(fixed, "FIRST_CHUNK_PAIR_STEPS", 50)
    run = verlet(pair_scene(), Wordy(1.0, "spring"), dt=1e-2)
    assert run.stats["engine"] == "plain"
    assert "Wordy" in run.stats["note"]
    with pytest.raises(TypeError, match="Wordy is not a dataclass whose fields are all numbers"):
        verlet(pair_scene(), Wordy(1.0, "spring"), dt=1e-2, engine="compiled")


@dataclass(frozen=True)
class Brittle:
    """A spring that cannot say what it does while it parts, between two depths where no check asks."""

    k: float

    def force(self, xi, xi_dot, pair):
        if 3.0e-3 < xi < 3.5e-3 and xi_dot < 0.0:
            raise ValueError("broken")
        return self.k * xi


@dataclass(frozen=True)
class Steep:
    """A spring whose force has no number while it parts, between two depths where no check asks."""

    k: float

    def force(self, xi, xi_dot, pair):
        return math.exp(1e3) if 3.0e-3 < xi < 3.5e-3 and xi_dot < 0.0 else self.k * xi


@pytest.mark.rotating
@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_a_law_that_raises_ends_the_run(engine):
    with pytest.raises(ValueError, match="broken"):
        verlet(pair_scene(), Brittle(1e4), dt=1e-4, engine=engine)


def test_a_law_without_a_number_says_so_where_it_is_deepest():
    """Infinite interpreted as compiled: no error, no shorter step to take."""
    run = verlet(pair_scene(), Steep(1e4), dt=1e-4, engine="plain")
    assert run.status is gr.Status.unstable
    assert run.message.endswith("beyond the range of numbers; the force of a law jumps or is not finite.")



@pytest.mark.parametrize("n", [36, 50, 88, 127])
def test_samples_do_not_change_the_step_on_which_a_flight_ends(n):
    """Balls that touch on a step: a second look at the flight rounded to the step after."""
    dt = 3e-5
    scene = gr.Scene(mass=[1.0, 1.0], radius=[0.1, 0.1], gap=[n * dt], velocity=[1.0, 0.0])
    run = partial(gr.md.simulate, scene, gr.LinearDashpot(1e6), method="rk4", dt=dt, t_end=n * dt + 1e-3)
    bare, rich = run(), run(samples=7)
    assert rich.contacts.tobytes() == bare.contacts.tobytes()


def test_free_flight_is_exact_and_costs_no_steps():
    scene = gr.scenes.bouncing_ball(height=1.0)
    run = verlet(scene, gr.LinearDashpot(1e6), samples=[0.1, 0.2, 0.4], t_end=0.4)
    np.testing.assert_allclose(run.velocity[:, 1], -9.81 * np.array([0.1, 0.2, 0.4]), rtol=1e-13)
    np.testing.assert_allclose(run.gap[:, 0], 1.0 - 0.5 * 9.81 * np.array([0.1, 0.2, 0.4]) ** 2, rtol=1e-13)
    assert run.stats["steps"] < 5


def test_log_of_an_initial_overlap():
    run = verlet(pair_scene(gap=-0.1, speed=0.0), gr.LinearDashpot(1.0), dt=1e-3)
    (row,) = run.contacts
    assert row["t_begin"] == 0.0
    assert row["xi_max"] == pytest.approx(0.1, rel=1e-6)
    assert row["duration"] == pytest.approx(0.5 * math.pi, rel=1e-5)
    assert run.energy()[-1] == pytest.approx(0.5 * 0.1**2, rel=1e-5)


def test_until_a_contact_that_is_there_from_the_start():
    run = verlet(pair_scene(gap=-0.1), gr.LinearDashpot(1.0), until=gr.until.contact(0, 1), dt=1e-3)
    assert run.status is gr.Status.until
    assert run.time[-1] == 0.0
    assert len(run.contacts) == 0


def test_contacts_and_steps_are_limited():
    scene = gr.scenes.gas(n=10, seed=3)
    run = verlet(scene, gr.LinearDashpot(1e5), max_events=7)
    assert run.status is gr.Status.max_events
    assert len(run.contacts[~np.isnan(run.contacts["t_end"])]) == 7
    rests = gr.Scene([math.inf, 1.0], [0.0, 0.1], [0.0], [0.0, 0.0], gravity=9.81)
    assert verlet(rests, gr.LinearDashpot(1e5, 1e3), max_steps=100).status is gr.Status.max_events


def test_callbacks():
    scene, law = three_balls()
    rows, seen = [], []
    run = verlet(scene, law, until=gr.until.contact(0, 2), on_event=rows.append,
                         on_progress=lambda t, n: seen.append((t, n)))
    assert [int(row["pair"]) for row in rows] == [1, 1, 1, 1, 0]
    assert rows == sorted(rows, key=lambda row: row["t_end"])
    assert seen[-1][1] == len(run.contacts)

    def stop(row):
        raise KeyError("mine")

    with pytest.raises(KeyError, match="mine"):
        verlet(scene, law, until=gr.until.contact(0, 2), on_event=stop)


@pytest.mark.rotating
def test_memory_of_walton_braun():
    run = verlet(pair_scene(), gr.WaltonBraun.from_restitution(0.5, 1.0), dt=1e-3)
    assert restitution(run) == pytest.approx(0.5, abs=2e-6)
    assert run.contacts[0]["duration"] == pytest.approx(0.75 * math.pi, rel=1e-5)


def test_moving_wall_pushes_without_energy_alarm():
    piston = gr.Scene([math.inf, 1.0], [0.0, 0.1], [1.0], [2.0, 0.0])
    run = verlet(piston, gr.LinearDashpot(1e4), dt=1e-4)
    assert run.status is gr.Status.quiet
    assert run.velocity[-1][1] == pytest.approx(4.0, rel=1e-5)


def test_rows_are_told_also_when_no_log_is_kept():
    scene, law = three_balls()
    rows = []
    run = verlet(scene, law, until=gr.until.contact(0, 2), log=False, on_event=rows.append)
    assert len(rows) == run.stats["contacts"] == 5
    assert len(run.contacts) == 0


@cache
def row_that_is_hit(n, way, gap):
    """The run of "located", which serves all methods."""
    gaps, speeds = [gap] + [0.0] * (n - 2), [1.0] + [0.0] * (n - 1)
    scene = gr.Scene([1.0] * n, [0.5] * n, gaps[::way], [way * v for v in speeds[::way]])
    return gr.md.simulate(scene, gr.Hertz(1e6), t_end=0.12)


@pytest.mark.rotating
@pytest.mark.parametrize("method", ALL)
@pytest.mark.parametrize(("way", "gap"), [(1, 0.0), (-1, 3.3e-3), (1, -1e-3), (-1, 0.0)])
def test_a_touching_row_begins_when_it_is_hit(method, way, gap):
    """As "located" logs it, although the push is too weak for a number at the far end of the row at first."""
    n, dt = 20, 4e-5
    located = row_that_is_hit(n, way, gap)
    fixed = verlet(located.scene, gr.Hertz(1e6), t_end=0.12, dt=dt, method=method)
    assert len(fixed.contacts) == len(located.contacts) == n - 1
    for c in range(n - 1):
        assert fixed.of(c)["t_begin"][0] == pytest.approx(located.of(c)["t_begin"][0], abs=dt)
    far = fixed.of(n - 2 if way > 0 else 0)[0]
    np.testing.assert_array_equal(far["v_in"], 0.0)


@pytest.mark.parametrize("engine", ["plain", "compiled"])
def test_a_row_at_a_rounding_before_a_step_is_the_row_of_that_step(engine):
    """66 · 5e-6 > 3.3e-4: the row was sought in a flight, of which there was none, or one long over."""
    law, options = gr.LinearDashpot(1e6, 20.0), {"method": "verlet", "dt": 5e-6, "engine": engine}
    touching = gr.Scene([1.0] * 3, [0.05] * 3, [-1e-5, 1e-3], [0.0] * 3)
    flying = gr.Scene([1.0] * 3, [0.05] * 3, [1e-4, 1.0], [1.0, -1.0, 0.0])
    for scene, t_end in ((touching, 3.3e-4), (flying, 1.75e-4)):
        row, near = (gr.md.simulate(scene, law, t_end=t, **options) for t in (t_end, t_end * (1.0 + 1e-9)))
        np.testing.assert_allclose(row.velocity[-1], near.velocity[-1], atol=1e-6)
    times = np.array([float(f"{k * 5e-6:.9g}") for k in range(400)])
    rows = gr.md.simulate(flying, law, samples=times, t_end=2e-3, **options)
    beside = gr.md.simulate(flying, law, samples=times + 1e-12, t_end=2.1e-3, **options)
    np.testing.assert_allclose(rows.velocity[:400], beside.velocity[:400], atol=1e-5)


def test_parting_balls_fly_to_the_end_in_one_go():
    run = verlet(gr.Scene([1.0] * 3, [0.05] * 3, [0.1] * 2, [-1.0, 0.0, 1.0]), gr.Hertz(1e6), dt=1e-6, t_end=1e-3)
    assert (run.stats["steps"], run.stats["flights"]) == (0, 1)
    np.testing.assert_allclose(run.gap[-1], 0.101, rtol=1e-14)
