"""Closed forms of hard spheres, energy and an oblique impact of soft spheres."""

import math

import numpy as np
import pytest

import granular as gr
from bench.threed import ensembles, gas

pytestmark = pytest.mark.soak
PAIR = gr.Pair(m_eff=0.5, r_eff=0.25, index=0)


@pytest.mark.parametrize("packing", [0.05, 0.2, 0.4])
def test_hard_spheres_have_the_rate_of_enskog_and_the_pressure_of_carnahan_and_starling(packing):
    rates, pressures = [], []
    for seed in range(4):
        x, v, radius, mass, box = gas.start(500, packing, seed)
        count, virial, _, heat, time = gas.hard(x, v, radius, mass, 1.0, box, 0.0, 0.0, np.inf, 10_000)
        rates.append(2.0 * count / 500 / time / ensembles.collision_rate(packing))
        contact_value = (1.0 - 0.5 * packing) / (1.0 - packing) ** 3
        pressures.append(virial / (3.0 * time * 500) / (4.0 * packing * contact_value))
        assert gas.energy(x, v, mass, 0.0) == pytest.approx(750.0, rel=1e-12)
        assert heat / time == pytest.approx(750.0, rel=1e-12)
        gaps = [math.sqrt(sum(r * r for r in gas.separation(x, v, i, j, box, 0.0, 0.0)[:3])) - 1.0
                for i in range(0, 500, 7) for j in range(500) if i != j]
        assert min(gaps) > -1e-9
    assert np.mean(rates) == pytest.approx(1.0, abs=0.01)
    assert np.mean(pressures) == pytest.approx(1.0, abs=0.01)


def test_energy_of_elastic_soft_spheres_is_kept_and_momentum_too():
    x, v, radius, mass, box = gas.start(500, 0.3, 1)
    _, _, _, elastic, log = gas.soft(x, v, radius, mass, 2e4, 0.0, box, 0.0, 0.0, 2e-4, 5000)
    assert gas.energy(x, v, mass, 0.0) + elastic == pytest.approx(750.0, rel=2e-4)
    assert np.abs((mass[:, None] * v).sum(axis=0)).max() < 1e-10
    assert len(log) > 1000


def test_an_oblique_impact_is_that_of_the_package():
    law = gr.LinearDashpot.from_restitution(0.9, k=4e3, pair=PAIR)
    hit = gr.binary.oblique(law, PAIR, 1.0, 0.8, 0.6)
    x, v = np.array([[5.0, 5.0, 5.0], [6.0, 5.0, 5.0]]), np.array([[0.4, 0.3, 0.0], [-0.4, -0.3, 0.0]])
    gas.soft(x, v, np.full(2, 0.5), np.ones(2), law.k, 0.5 * law.gamma / math.sqrt(law.k * 0.5), 10.0, 0.0, 0.0,
             hit.duration / 4000, 6000)
    assert v[1, 0] - v[0, 0] == pytest.approx(hit.restitution * 0.8, abs=1e-3)
    assert v[0, 1] - v[1, 1] == pytest.approx(hit.tangential * 0.6, abs=1e-3)
