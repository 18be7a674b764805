"""Bands and gaps of chains under pressure: against eigenvalues, linear equations, recipes, and long runs."""

import math

import numpy as np
import pytest

import granular as gr
from granular import waves
from tests.helpers.steel_chains import FORCE, RADIUS, laws_of, steel


def test_numbers_of_steel_beads():
    scene = gr.scenes.compressed_chain(10, FORCE, law=steel)
    law = laws_of(scene, steel)
    k, m = waves.stiffness(scene, law)[5], scene.mass[1]
    assert law[5].k == pytest.approx(9.75758e9, rel=1e-6)
    assert k == pytest.approx(1.5 * law[5].k ** (2 / 3) * FORCE ** (1 / 3), rel=1e-14)
    assert k == pytest.approx(1.859214e7, rel=4e-7)
    cut = waves.band_edges(k, m)[0, 1]
    assert cut / (2.0 * math.pi) == pytest.approx(8051.863, abs=1e-3)
    assert waves.sound_speed(k, m, 2.0 * RADIUS) == pytest.approx(481.8826, abs=1e-4)
    assert waves.decay(1.1 * cut, k, m) == pytest.approx(0.411833347, abs=5e-10)
    assert waves.crossing_time(scene, [law[5]] * 11) == pytest.approx(0.2 / 481.8826, rel=0.2)


def test_a_wave_crosses_what_it_is_pressed_against_only():
    """Balls that are apart carry nothing; of several piles the longest counts, wherever a ring is cut."""
    gap = np.array([-1e-4, -1e-4, -1e-4, 0.5, -1e-4, 0.3, 0.2, -1e-4, -2e-4])
    gaps = [gap[:4], gap, *(np.roll(gap, k) for k in range(9))]
    law, mass = gr.LinearDashpot(1e6), np.arange(1.0, 10.0)
    scenes = [gr.Scene(mass[:5], [0.1] * 5, gaps[0], [0.0] * 5), gr.Scene([*mass, 1.0], [0.1] * 10, gap, [0.0] * 10)]
    scenes += [gr.Scene(np.roll(mass, k), [0.1] * 9, one, [0.0] * 9, ring=True) for k, one in enumerate(gaps[2:])]
    times = [waves.crossing_time(scene, law) ** 2 * 1e6 for scene in scenes]
    assert times == pytest.approx([10.0 * 3.0, 18.0 * 2.0, *[27.0 * 5.0] * 9], rel=1e-14)
    assert waves.crossing_time(scenes[0].replace(gap=[0.1] * 4), law) == math.inf


def test_edges_of_the_gap_of_two_masses():
    edges = waves.band_edges(1.0, [1.0, 2.0])
    assert edges == pytest.approx(np.array([[0.0, 1.0], [math.sqrt(2.0), math.sqrt(3.0)]]), abs=1e-15)
    assert edges[0, 0] == 0.0


@pytest.mark.parametrize("seed", range(6))
def test_dispersion_against_eigenvalues_of_a_closed_chain(seed):
    """N cells joined to a ring have the frequencies of an endless chain at the phases 2πj/N."""
    random = np.random.default_rng(seed)
    p, cells = int(random.integers(1, 5)), 7
    k, m = 10.0 ** random.uniform(-1, 1, (2, p))
    n = p * cells
    matrix = np.zeros((n, n))
    for j in range(n):
        a, b = j, (j + 1) % n
        matrix[a, a] += k[j % p]
        matrix[b, b] += k[j % p]
        matrix[a, b] -= k[j % p]
        matrix[b, a] -= k[j % p]
    root = np.sqrt(np.tile(m, cells))
    expected = np.sqrt(np.maximum(np.linalg.eigvalsh(matrix / np.outer(root, root)), 0.0))
    found = np.sort(waves.dispersion(2.0 * math.pi * np.arange(cells) / cells, k, m).ravel())
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_modes_of_a_chain_between_walls_are_standing_waves_of_the_dispersion(seed):
    random = np.random.default_rng(seed)
    n, k = int(random.integers(2, 9)), 10.0 ** random.uniform(5, 8)
    scene = gr.scenes.compressed_chain(n, law=gr.LinearDashpot(k))
    expected = waves.dispersion(math.pi * np.arange(1, n + 1) / (n + 1), k, scene.mass[1])[:, 0]
    assert waves.modes(scene, gr.LinearDashpot(k)) == pytest.approx(expected, rel=1e-12)


def test_a_mode_swings_with_its_frequency_in_a_run():
    law, amplitude = steel, 1e-5
    scene = gr.scenes.compressed_chain(6, law=law, dimer=0.3)
    laws = laws_of(scene, law)
    k, m = waves.stiffness(scene, laws), scene.mass[1:-1]
    square, shape = np.linalg.eigh((np.diag(k[:-1] + k[1:]) - np.diag(k[1:-1], 1) - np.diag(k[1:-1], -1))
                                   / np.sqrt(np.outer(m, m)))
    omega = waves.modes(scene, laws)
    assert omega == pytest.approx(np.sqrt(square), rel=1e-12)
    start = np.array([0.0, *(amplitude * shape[:, 2] / np.sqrt(m)), 0.0]) * math.sqrt(m[0]) * 1e-3
    run = gr.md.simulate(scene.replace(velocity=start), laws, t_end=20 * math.pi / omega[2])
    assert run.velocity[-1] == pytest.approx(start, abs=1e-4 * np.abs(start).max())  # not quite linear


@pytest.mark.parametrize("seed", range(8))
def test_decay_against_the_response_of_a_long_chain(seed):
    """Shake one end of a long chain in a gap: linear equations for the amplitudes."""
    random = np.random.default_rng(seed)
    p, cells = int(random.integers(1, 4)), 40
    k, m = random.uniform(0.5, 2.0, (2, p))
    edges = waves.band_edges(k, m)
    gaps = [(low, high) for low, high in zip(edges[:, 1], [*edges[1:, 0], 1.5 * edges[-1, 1]], strict=True)
            if high > 1.02 * low]
    low, high = gaps[int(random.integers(len(gaps)))]
    omega = random.uniform(0.8 * low + 0.2 * high, 0.2 * low + 0.8 * high)
    n = p * cells  # balls 1 … n; ball 0 is shaken, ball n + 1 held; contact j joins j and j + 1
    stiff = np.tile(k, cells + 1)[: n + 1]
    heavy = np.array([m[j % p] for j in range(1, n + 1)])
    matrix = np.diag(stiff[:-1] + stiff[1:] - omega**2 * heavy) - np.diag(stiff[1:-1], 1) - np.diag(stiff[1:-1], -1)
    u = np.abs(np.linalg.solve(matrix, np.eye(n)[0] * stiff[0]))
    rate = waves.decay(omega, k, m)
    assert rate < 1.0
    assert waves.decay(omega, np.tile(k, 300), np.tile(m, 300)) == pytest.approx(rate, rel=1e-11)
    assert (u[3 * p] / u[p]) ** (1.0 / (2 * p)) == pytest.approx(rate, rel=1e-6)
    assert waves.decay(0.5 * (edges[0, 0] + edges[0, 1]), k, m) == 1.0


def shaken(scene, laws, omega, amplitude, periods, seen=16):
    """Amplitudes of all bodies in the last periods of a run, complex; the floor sets in softly."""
    turn = 2.0 * math.pi / omega
    middle, soft = 0.4 * periods * turn, 0.062 * periods * turn

    def path(t):
        return 0.5 * amplitude * math.erfc((middle - t) / (soft * math.sqrt(2.0))) * math.sin(omega * t)

    times = np.linspace((periods - seen) * turn, periods * turn, 12 * seen, endpoint=False)
    run = gr.md.simulate(scene.replace(floor=gr.walls.Motion(path)), laws, t_end=periods * turn, samples=times)
    assert run.status is gr.Status.time
    moved = run.position - scene.position
    wave = np.exp(-1j * omega * run.time)[:, None]
    return 2.0 * ((moved - moved.mean(axis=0)) * wave).mean(axis=0)


@pytest.mark.rotating
def test_decay_above_the_cut_off_measured_in_a_run():
    """The recipe's digits: 0.411833347 from ball to ball at 1.1 ω_c, by the located engine."""
    scene = gr.scenes.compressed_chain(12, FORCE, law=steel)
    k, m = waves.stiffness(scene, laws_of(scene, steel))[5], scene.mass[1]
    spring = gr.LinearDashpot(float(k))
    scene = gr.scenes.compressed_chain(12, FORCE, law=spring)
    u, rate = shaken(scene, spring, 1.1 * waves.band_edges(k, m)[0, 1], 1e-8, 160), 0.411833347
    assert abs(u[1] / u[0]) == pytest.approx(rate, abs=2e-9)
    back = np.array([rate**j - rate ** (26 - j) for j in range(8)])  # the wall beyond ball 12 sends it back
    assert np.abs(u[1:8] / u[:7]) == pytest.approx(back[1:] / back[:-1], abs=1e-6)
    assert (u[1:8] / u[:7]).real.max() < -0.4  # neighbours move against each other


@pytest.mark.rotating
def test_a_matched_end_sends_back_little():
    """tan(θ/4) of the amplitude, from linear equations with a resistance √(K m) at the end; a wall sends back all."""
    n, spring = 8, gr.LinearDashpot(1e7)
    scene = gr.scenes.compressed_chain(n, FORCE, law=spring)
    laws, m = waves.matched_end(scene, spring), scene.mass[1]
    assert laws[-1] == gr.MatchedEnd(FORCE, 1e7)
    omega = 0.4 * 2.0 * math.sqrt(1e7 / m)
    u = shaken(scene, laws, omega, 1e-9, 40, 8)
    theta = 2.0 * math.asin(0.4)
    away = np.exp(-1j * theta * np.arange(n + 1))
    (there, back), *_ = np.linalg.lstsq(np.array([away, away.conj()]).T, u[:-1], rcond=None)
    assert u[:-1] == pytest.approx(there * away + back * away.conj(), abs=2e-3 * abs(there))
    assert abs(back / there) == pytest.approx(math.tan(0.25 * theta), abs=2e-3)
