"""Piles that ride on driven walls, piece by piece: their account, the reference, until they lift off, or are hit."""

import math
from dataclasses import dataclass

import numpy as np
import pytest

import granular as gr
from bench import reference

G = 9.81


@dataclass(frozen=True)
class Stiffening:
    """A force that no power series follows."""

    k: float
    damping: float

    def force(self, xi, eta, pair):
        return self.k * (xi + 1e4 * xi * xi * xi) + self.damping * eta


def laws_of(kind, scene, k, rng):
    if kind == "dashpot":
        restitution = float(rng.uniform(0.2, 0.9))
        return [gr.LinearDashpot.from_restitution(restitution, k, pair) for pair in scene.pairs]
    return {
        "viscoelastic": gr.ViscoelasticHertz(300.0 * k, 300.0 * k * float(rng.uniform(1e-3, 4e-3))),
        "tsuji": gr.TsujiHertz(1e3 * k, 1.5), "own": Stiffening(k, 0.8 * math.sqrt(0.5 * k)),
        "mixed": [gr.ViscoelasticHertz(300.0 * k, 0.6 * k) if i % 2 else gr.LinearDashpot(k, math.sqrt(0.5 * k))
                  for i in range(scene.n_pairs)],
    }[kind]


def piled(where, kind, seed):
    """One to four balls that touch on a driven floor, hang under a driven ceiling, or are pressed between two walls."""
    rng = np.random.default_rng(seed)
    alone = kind not in ("dashpot", "mixed") and where in ("floor", "hanging")  # few balls: their swings soon die
    n, k = int(rng.integers(1, 3 if alone else 5)), 10.0 ** rng.uniform(5.0, 6.0) * (4.0 if alone else 1.0)
    omega = 2.0 * math.pi * rng.uniform(0.5, 3.0)
    mass, start = np.exp(rng.uniform(-1.0, 1.0, n)), float(rng.choice([0.0, 0.37, 12.0]))
    amplitude, phase, path = rng.uniform(0.1, 0.3) * G / omega**2, float(rng.uniform(0.0, 6.0)), rng.integers(3)
    gap, floor, ceiling, force = [0.0] * n, None, None, None
    if where in ("between", "squeezed"):
        gap = [-3.0 * G * mass.sum() / k] * (n + 1)
        amplitude = amplitude if where == "between" else -0.1 * sum(gap)
    breaks = start + np.linspace(-0.05, 3.0, 14)
    motion = [
        gr.walls.Sine(amplitude, omega / (2.0 * math.pi), phase),
        gr.walls.Motion(lambda t: amplitude * (math.sin(omega * t) + 0.2 * math.cos(2.3 * omega * t))),
        gr.walls.Piecewise(breaks, [0.0 * breaks[1:], *hermite(breaks, amplitude, omega)]),
    ][path]
    stiffness, p = {"viscoelastic": (300.0 * k, 1.5), "tsuji": (1e3 * k, 1.5)}.get(kind, (k, 1.0))
    if where == "floor":
        gap = -((G * np.cumsum(mass[::-1])[::-1] / stiffness) ** (1.0 / p))
        force = [0.0, *(0.2 * G * mass)] if rng.random() < 0.5 else None
        mass, floor = [math.inf, *mass], motion
    elif where == "hanging":
        gap = -((1.2 * G * np.cumsum(mass) / stiffness) ** (1.0 / p))
        mass, ceiling, force = [*mass, math.inf], motion, [*(2.2 * G * mass), 0.0]
    else:
        mass = [math.inf, *mass, math.inf]
        floor = motion if where == "between" or path else None
        ceiling = motion if where == "between" or floor is None else None
    zero = np.zeros(len(mass))
    scene = gr.Scene(mass, zero, gap, zero, gravity=G, external_force=force, floor=floor, ceiling=ceiling)
    return scene, laws_of(kind, scene, k, rng), start


def hermite(breaks, amplitude, omega):
    """Cubic pieces through the values and slopes of a sine; the first row, of quartic terms, is left out."""
    h = np.diff(breaks)
    x, v = amplitude * np.sin(omega * breaks), amplitude * omega * np.cos(omega * breaks)
    rise = np.diff(x) / h
    return [(v[:-1] + v[1:] - 2.0 * rise) / h**2, (3.0 * rise - 2.0 * v[:-1] - v[1:]) / h, v[:-1], x[:-1]]


def simulate(scene, law, start, length, **options):
    return gr.md.simulate(scene, law, t_start=start, t_end=start + length, engine="plain", **options)


def remainder(run):
    """Largest error of the account, as a part of Σ|ΔW|."""
    account = run.account()
    total = account["energy"] - account["work"].sum(axis=1) + account["dissipated"]
    return abs(total - total[0]).max() / abs(np.diff(account["work"], axis=0)).sum()


@pytest.mark.parametrize(("where", "kind", "seed"), [
    ("floor", "dashpot", 1), ("floor", "viscoelastic", 3), ("squeezed", "mixed", 3), ("hanging", "tsuji", 3),
    *(pytest.param(*case, marks=pytest.mark.soak) for case in (
        ("hanging", "dashpot", 2), ("squeezed", "dashpot", 2), ("floor", "dashpot", 0), ("between", "dashpot", 22),
        ("squeezed", "viscoelastic", 2), ("floor", "own", 1), ("between", "viscoelastic", 4),
    )),
])
def test_the_account_of_a_ride_closes(where, kind, seed):
    scene, law, start = piled(where, kind, seed)
    run = simulate(scene, law, start, 0.15, samples=7)
    assert remainder(run) < 1e-13
    assert (np.diff(run.account()["dissipated"]) > 0.0).all()
    assert run.force[-1].min() > 0.0


@pytest.mark.rotating
@pytest.mark.parametrize("kind", ["dashpot", pytest.param("viscoelastic", marks=pytest.mark.soak)])
def test_a_ride_against_the_reference(kind):
    pytest.importorskip("mpmath")
    scene, law, start = piled("squeezed", kind, 14)
    soft = simulate(scene, law, start, 0.05)
    true = reference.solve(scene, law, t_start=start, t_end=start + 0.05, digits=20)
    assert max(abs(float(a) - b) for a, b in zip(true.gap, soft.gap[-1], strict=True)) < 1e-14 * abs(soft.gap).max()
    work, dissipated = soft.account()["work"][-1], soft.account()["dissipated"][-1]
    for a, b in zip(true.account, (*work, 0.0, 0.0, dissipated), strict=True):
        assert float(a) == pytest.approx(b, rel=1e-12, abs=1e-14 * dissipated)


@pytest.mark.rotating
@pytest.mark.parametrize(("ratio", "part"), [(1e3, 1.2), (1e3, 1.0001), (1e4, 1.01)])
def test_a_ball_that_rides_lifts_off_to_rounding(ratio, part):
    mp = pytest.importorskip("mpmath").MPContext()
    mp.dps = 40
    f = 1.0 / (2.0 * math.pi)
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [0.0], [0.0, 0.0], gravity=1.0,
                     floor=gr.walls.Sine.from_acceleration(1.0, f, gravity=1.0))
    law = gr.LinearDashpot.from_restitution(0.5, ratio**2, scene.pairs[0])
    gamma = abs(law.k - 1.0 + 1j * law.gamma) / abs(law.k + 1j * law.gamma)
    floor = gr.walls.Sine.from_acceleration(part * gamma, f, gravity=1.0)
    omega, k, c = 2 * mp.pi * mp.mpf(floor.frequency), mp.mpf(law.k), mp.mpf(law.gamma)
    sway = -mp.mpf(floor.amplitude) * omega**2 / (k - omega**2 + 1j * c * omega)
    gap, speed = -float(1 / k + sway.imag), float(mp.mpf(floor.amplitude) * omega - (1j * omega * sway).imag)
    run = gr.md.simulate(scene.replace(gap=[gap], velocity=[0.0, speed], floor=floor), law, t_end=2.0, engine="plain")
    near = math.asin(1.0 / part)
    end = mp.findroot(lambda t: 1 + ((k + 1j * c * omega) * sway * mp.expj(omega * t)).imag, (near - 1e-4, near + 1e-4))
    slope = part * math.cos(float(end))  # of the force, which rounding moves
    assert abs(float(end) - run.contacts["t_end"][0]) < 1e-15 * (1.0 + 1.0 / slope)


def test_a_ball_falls_on_one_that_rides():
    pytest.importorskip("mpmath")
    floor, load = gr.walls.Sine.from_acceleration(0.2, 5.0, phase=0.5 * math.pi), 1.2 * G * 1e-5
    scene = gr.Scene([math.inf, 1.0, 2.0, 0.5], [0.0] * 4, [-3.0 * load, -2.0 * load, 1e-3], [0.0, 0.0, 0.0, -0.5],
                     gravity=G, floor=floor)
    law = [gr.LinearDashpot.from_restitution(0.5, 1e5, pair) for pair in scene.pairs]
    run, true = simulate(scene, law, 0.0, 0.02), reference.solve(scene, law, t_end=0.02, digits=20)
    assert sorted(row.pair for row in true.contacts) == sorted(run.contacts["pair"].tolist())
    assert len(true.contacts) > 2
    begun = sorted(run.contacts["t_begin"].tolist())
    assert begun == pytest.approx(sorted(float(row.t_begin) for row in true.contacts), rel=1e-13, abs=1e-15)
    assert max(abs(float(a) - b) for a, b in zip(true.gap, run.gap[-1], strict=True)) < 1e-14 * abs(run.gap).max()


def test_a_ride_ends_where_the_velocity_of_the_wall_jumps():
    pytest.importorskip("mpmath")
    slopes, breaks = [0.05, 0.0, 0.03], [-1.0, 0.1, 0.2, 1.0]
    floor = gr.walls.Piecewise(breaks, [slopes, [0.0, 0.055, 0.055]])
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [-G * 1e-6], [0.0, 0.05], gravity=G, floor=floor)
    law = gr.LinearDashpot.from_restitution(0.3, 1e6, scene.pairs[0])
    run = simulate(scene, law, 0.09, 0.03)
    true = reference.solve(scene, law, t_start=0.09, t_end=0.12, digits=20)
    assert len(run.contacts) == len(true.contacts) > 1
    begun = sorted(run.contacts["t_begin"].tolist())
    assert begun == pytest.approx(sorted(float(row.t_begin) for row in true.contacts), rel=1e-13)
    assert max(abs(float(a) - b) for a, b in zip(true.gap, run.gap[-1], strict=True)) < 1e-13 * abs(run.gap).max()


@pytest.mark.rotating
@pytest.mark.parametrize(("where", "kind", "seed"), [("squeezed", "dashpot", 2), ("floor", "viscoelastic", 5)])
def test_samples_and_a_resumed_run_change_no_bit_of_a_ride(where, kind, seed):
    scene, law, start = piled(where, kind, seed)
    whole = simulate(scene, law, start, 0.3)
    seen = simulate(scene, law, start, 0.3, samples=14)
    first = simulate(scene, law, start, 0.17)
    later = gr.md.resume(first, t_end=start + 0.3)
    for run in (seen, later):
        assert np.array_equal(run.gap[-1], whole.gap[-1])
        assert run.stats["steps"] == whole.stats["steps"]
        assert run.account()["dissipated"][-1] == pytest.approx(whole.account()["dissipated"][-1], rel=1e-15)


def test_the_limit_of_work_holds_on_a_ride():
    scene = gr.scenes.vibrated_column(2, gamma=0.5, gap=0.0)
    run = gr.md.simulate(scene, gr.LinearDashpot(1e7, 5.0), t_end=5.0, max_steps=500, engine="plain")
    assert run.status is gr.Status.max_events
    assert run.stats["steps"] == 500


@pytest.mark.soak
@pytest.mark.parametrize(("where", "kind", "seed"), [
    ("floor", "dashpot", 0), ("hanging", "dashpot", 13), ("squeezed", "dashpot", 2), ("squeezed", "viscoelastic", 2),
])
def test_compiled_rides_have_the_same_bits(where, kind, seed):
    scene, law, start = piled(where, kind, seed)
    one, other = (gr.md.simulate(scene, law, t_start=start, t_end=start + 0.3, samples=9, engine=engine)
                  for engine in ("plain", "compiled"))
    assert one.contacts.tobytes() == other.contacts.tobytes()
    assert all(np.array_equal(getattr(one, name), getattr(other, name)) for name in ("gap", "velocity", "force"))
    assert all(np.array_equal(values, other.account()[name], equal_nan=True) for name, values in one.account().items())
