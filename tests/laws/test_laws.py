"""Force laws: formulas, traits, inverses, misuse."""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

import granular as gr
from granular.laws import dashpot, resolve
from granular.laws.kinds import checked

MAPPING = json.loads((Path(__file__).parents[1] / "reference/restitution_mapping.json").read_text())
PAIR = gr.Pair(m_eff=0.3, r_eff=0.02, index=0)
LAWS = [
    gr.LinearDashpot(1e5, 3.0),
    gr.Hertz(1e7),
    gr.ViscoelasticHertz(1e7, 2e2),
    gr.TsujiHertz(1e7, 0.3),
    gr.PowerLaw(1e8, 2.0),
    gr.WaltonBraun(1e5, 3e5),
]


@pytest.mark.parametrize("row", MAPPING["forward"], ids=lambda row: f"zeta={row['zeta']}")
def test_restitution_and_duration_from_damping(row):
    assert dashpot.restitution(row["zeta"]) == pytest.approx(row["eps"], rel=1e-13)
    assert dashpot.reduced_duration(row["zeta"]) == pytest.approx(row["omega0_tc"], rel=1e-13)


@pytest.mark.parametrize("row", MAPPING["inverse"], ids=lambda row: f"eps={row['eps']}")
def test_damping_from_restitution(row):
    assert dashpot.damping_ratio(row["eps"]) == pytest.approx(row["zeta"], rel=1e-13)


@given(st.floats(1e-12, 1.0))
def test_damping_and_restitution_are_inverse(eps):
    zeta = dashpot.damping_ratio(eps)
    condition = 1.0 + abs(math.log(eps))  # d ln ε / d ln ζ
    assert dashpot.restitution(zeta) == pytest.approx(eps, rel=1e-15 * (1.0 + 4.0 * condition))


@pytest.mark.parametrize("law", LAWS[:5], ids=lambda law: type(law).__name__)
def test_potential_is_the_integral_of_the_elastic_force(law):
    xi = 3e-4
    bare = type("bare", (), {"force": law.force})()
    assert law.potential(xi, PAIR) == pytest.approx(resolve(bare, PAIR).energy(xi), rel=1e-12)


@pytest.mark.parametrize("law", LAWS[:5], ids=lambda law: type(law).__name__)
def test_power_form_is_the_force(law):
    k, p, gamma, d = resolve(law, PAIR).form
    for xi, rate in ((1e-5, 0.2), (3e-3, -1.0)):
        assert law.force(xi, rate, PAIR) == pytest.approx(k * xi**p + gamma * xi**d * rate, rel=1e-14)


def test_walton_braun_branches():
    law = gr.WaltonBraun.from_restitution(0.5, k_load=1e5)
    assert law.k_unload == pytest.approx(4e5)
    assert law.force(1e-3, 1.0, PAIR, 1e-3) == pytest.approx(100.0)
    assert law.force(8e-4, -1.0, PAIR, 1e-3) == pytest.approx(100.0 - 4e5 * 2e-4)
    assert law.force(7.5e-4, -1.0, PAIR, 1e-3) == pytest.approx(0.0, abs=1e-12)


def test_material_constants_of_the_paper():
    law = gr.ViscoelasticHertz.from_material(5e7, 0.45, 1e-4, gr.Pair(1.0, 0.1, 0))
    assert law.k == pytest.approx(13217461.484507333, rel=1e-14)
    assert law.gamma == pytest.approx(1.5e-4 * law.k, rel=1e-15)


@pytest.mark.parametrize("eps", [0.999, 0.7, 0.2, 0.01])
def test_laws_made_from_restitution_have_it(eps):
    made = [
        gr.LinearDashpot.from_restitution(eps, 1e5, PAIR),
        gr.TsujiHertz.from_restitution(eps, 1e7),
        gr.ViscoelasticHertz.from_restitution(eps, 2.0, 1e7, PAIR),
    ]
    for law in made:
        assert gr.binary.restitution(law, PAIR, 2.0) == pytest.approx(eps, rel=1e-12)


def test_a_trait_that_contradicts_the_force_is_refused():
    @dataclass(frozen=True)
    class Wrong:
        k: float

        def force(self, xi, xi_dot, pair):
            return self.k * xi * xi

        def linear(self, pair):
            return self.k, 0.0

    with pytest.raises(ValueError, match=r"The law of pair floor–1, \S+Wrong\(k=2\.0\), must have a force that agrees "
                                         r"with its linear or power trait, got force\(0\.25, 0\.5\) = 0\.125 and 0\.5 "
                                         r"by the trait\. Fix the trait or leave it out\."):
        checked(Wrong(2.0), gr.scenes.three_balls())


def test_flat_wall_leaves_the_ball_its_own_radius_and_mass():
    pair = gr.scenes.three_balls(radii=(0.1, 0.01)).pairs[0]
    assert pair.r_eff == 0.1
    assert pair.m_eff == gr.scenes.three_balls(radii=(0.1, 0.01)).mass[1]
