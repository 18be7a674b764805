"""Solitary waves, and pulses in a pressed chain: against published digits, their equation, and long runs."""

import math
from dataclasses import replace

import numpy as np
import pytest

import granular as gr
from granular import waves
from granular.laws.contact_law import resolve
from tests.helpers.steel_chains import FORCE, RADIUS


def test_the_published_digits_of_the_discrete_solitary_wave():
    wave = waves.SolitaryWave(1.5)
    assert wave.speed == pytest.approx(0.90551577641912, abs=1e-14)
    assert wave.speed / wave.peak_velocity**0.2 == pytest.approx(0.90747007841219, abs=1e-14)
    for share, width in ((0.5, 1.411928348539), (0.01, 3.558618410626), (0.001, 4.304636982818)):
        assert wave.width(share) == pytest.approx(width, abs=6e-13)


@pytest.mark.parametrize("p", [1.1, 1.2, 1.5, 2.0, 3.7, 8.0])
def test_the_wave_solves_its_integrated_equation(p):
    """c² φ = Λ * φ^p and the velocity, by Gauss quadrature instead of Fourier series."""
    wave, (node, weight) = waves.SolitaryWave(p), np.polynomial.legendre.leggauss(60)
    s = 0.5 * (node + 1.0)
    for x in np.linspace(-2.0, 2.0, 17).tolist():
        both = wave.overlap(x + s) ** p + wave.overlap(x - s) ** p
        assert wave.speed**2 * wave.overlap(x) == pytest.approx(0.5 * weight @ ((1.0 - s) * both), abs=1e-13)
        assert wave.speed * wave.velocity(x) == pytest.approx(0.5 * weight @ wave.overlap(x + s) ** p, abs=1e-13)


    for share in (1e-6, 1e-12):  # far out, too
        x = 0.5 * wave.width(share)
        force = (0.5 * weight @ ((1.0 - s) * (wave.force(x + s) + wave.force(x - s))) / wave.speed**2) ** p
        assert force == pytest.approx(share, rel=1e-9 / share**0.5)


def speeds(scene, law, v):
    """Balls per second, and the largest overlap."""
    wave, pair = waves.SolitaryWave(resolve(law, scene.pairs[0]).form[1]), scene.pairs[0]
    k, p, m = law.k, wave.exponent, 2.0 * pair.m_eff
    deepest = (v * math.sqrt(m / k) / wave.peak_velocity) ** (2.0 / (p + 1.0))
    return wave.speed * math.sqrt(k * deepest ** (p - 1.0) / m), deepest


@pytest.mark.parametrize(("law", "n", "over"), [
    (gr.Hertz(9.75758e9), 113, 100), (gr.PowerLaw(1e13, 2.0), 33, 20), (gr.PowerLaw(1e20, 3.0), 33, 20),
])
def test_the_wave_keeps_shape_and_speed_in_a_run(law, n, over):
    """100 balls later it is the exact wave 100 balls further on."""
    scene = waves.solitary(n, 0.1, law=law)
    rate, deepest = speeds(scene, law, 0.1)
    assert scene.velocity.max() == pytest.approx(0.1, rel=1e-14)
    assert -scene.gap.min() <= deepest
    run = gr.md.simulate(scene, law, t_end=over / rate)
    there = waves.solitary(n, 0.1, law=law, at=6.0 + over)
    assert run.velocity[-1] == pytest.approx(there.velocity, abs=0.1 * 1e-14 * over)
    assert run.gap[-1] == pytest.approx(there.gap, abs=deepest * 5e-14 * over)


def test_sensors_see_speed_peak_and_widths_of_the_wave():
    law = gr.Hertz(9.75758e9)
    scene = waves.solitary(30, 0.1, law=law)
    rate, deepest = speeds(scene, law, 0.1)
    run = gr.md.simulate(scene, law, t_end=16.0 / rate, samples=1601)
    seen = waves.pulse(run)
    assert np.isnan(seen.time[0])
    assert seen.speed(10, 18) == pytest.approx(2.0 * RADIUS * rate, rel=1e-10)
    assert seen.peak[10:18] == pytest.approx(np.full(8, law.k * deepest**1.5), rel=1e-9)
    widths = seen.width[10:18] * rate
    assert widths[:, 0] == pytest.approx(np.full(8, 1.411928348539), abs=1e-7)
    assert widths[:, 1:] == pytest.approx(np.tile([3.558618410626, 4.304636982818], (8, 1)), abs=1e-6)


def test_a_small_pulse_in_a_pressed_chain_runs_at_the_speed_of_sound():
    law, long = gr.Hertz(9.75758e9), 24
    scene = gr.scenes.compressed_chain(48, FORCE, law=law)
    sound = waves.sound_speed(waves.stiffness(scene, law)[5], scene.mass[1], 2.0 * RADIUS)
    v, deeper = np.zeros(scene.n), np.zeros(scene.n_pairs)  # a long one, to the right only
    v[1 : long + 1] = 1e-6 * np.sin(math.pi * np.arange(1, long + 1) / (long + 1)) ** 2
    deeper[: long + 1] = 1e-6 * np.sin(math.pi * (np.arange(long + 1) + 0.5) / (long + 1)) ** 2 * 2.0 * RADIUS / sound
    run = gr.md.simulate(scene.replace(velocity=v, gap=scene.gap - deeper), law, t_end=0.7 / sound, samples=200)
    seen = waves.pulse(run, static=FORCE)
    assert seen.speed(22, 40) == pytest.approx(sound, rel=5e-3)
    force = run.force.copy()
    force[:, 44:] = FORCE
    force[10, 44:] = np.nextafter(FORCE, math.inf)  # rounding ahead of the pulse
    assert np.isnan(waves.pulse(replace(run, force=force), static=FORCE).time[44:]).all()
    assert seen.peak[22:40] == pytest.approx(np.full(18, 1e-6 * sound * scene.mass[1] / (2.0 * RADIUS)), rel=0.05)
