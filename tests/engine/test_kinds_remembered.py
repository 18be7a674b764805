"""What is remembered of laws, and of scenes with them, is what they give alone."""

from contextlib import suppress

import numpy as np
import pytest

import granular as gr
from granular.laws import kinds as of_laws
from granular.scene import Scene

KINDS = float, int, np.float32, np.float64, np.int64


@pytest.mark.parametrize("make", [gr.LinearDashpot, gr.Hertz, gr.WaltonBraun, gr.ViscoelasticHertz])
def test_what_is_remembered_of_laws_is_of_these_very_numbers(make):
    """Laws that are equal, of other types of numbers or signs of zero, give what they give alone, in any order."""
    scene, rng = Scene([1.0] * 3, [0.01] * 3, [1e-6, 1e-5], [1.0, 0.0, 0.0]), np.random.default_rng(5)
    numbers = (2**24,) if make is gr.Hertz else (2**24, 2**25) if make is gr.WaltonBraun else (2**24, 2**9)

    def result(law):
        try:
            run = gr.md.simulate(scene, law, t_end=2e-4, max_steps=60, engine="plain")
        except (TypeError, ValueError) as error:
            return str(error)
        return repr(run.law), run.gap.tobytes(), run.contacts.tobytes()

    laws = []
    for kind in KINDS:
        with suppress(TypeError, ValueError):  # a number that no law takes
            laws.append(make(*map(kind, numbers)))
    alone = []
    for law in laws:
        of_laws._cached_laws.cache_clear()
        alone.append(result(law))
    for i in rng.integers(0, len(laws), 12).tolist():
        assert result(laws[i]) == alone[i]


def test_zeros_of_both_signs_and_laws_with_a_trait_of_their_own_are_told_apart():
    scene = gr.scenes.three_balls()
    for gamma in (0.0, -0.0, 0.0):
        assert repr(of_laws.checked(gr.LinearDashpot(5e6, gamma), scene).given[0].gamma) == repr(gamma)
    odd = gr.LinearDashpot(5e6, 0.0)
    object.__setattr__(odd, "linear", lambda pair: (6e6, 0.0))
    of_laws.checked(gr.LinearDashpot(5e6, 0.0), scene)
    with pytest.raises(ValueError, match="by the trait"):
        of_laws.checked(odd, scene)


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(4))
def test_records_remembered_with_laws_are_those_of_the_scene(seed):
    """Scenes of the same laws in any order, with other places, speeds, masses, gravity, ends and ways: as alone."""
    rng = np.random.default_rng(seed)
    scene = gr.scenes.three_balls(gap=1e-4)
    mass = scene.mass.copy()
    mass[1:] = 1.0, 2.0
    law = [gr.LinearDashpot(1e6, 20.0), gr.ViscoelasticHertz(1e8, 1e3)][seed % 2]
    free = scene.replace(mass=[2.0, 1.0, 2.0], gravity=0.0)  # the same m_eff of pair 1
    asked = [
        (one.replace(gap=rng.uniform(1e-5, 1e-3, 2), velocity=np.array([0.0, -1.0, -1.5]) * rng.uniform(0.5, 2.0)), how)
        for one in (scene.replace(mass=mass), scene.replace(mass=mass, gravity=1.0), free,
                    free.replace(mass=[1.0, 2.0, 1.0]), scene.replace(mass=mass, radius=2.0 * scene.radius))
        for how in ({}, {"until": gr.until.contact(1, 1)}, {"until": gr.until.separated()}, {"tol": 1e-9},
                    {"max_events": 1}, {"disturbed": "stop"}, {"samples": 5}, {"log": False})]

    def result(one, how):
        run = gr.md.simulate(one, law, t_end=0.01, engine="plain", **how)
        return run.message, run.gap.tobytes(), run.velocity.tobytes(), run.contacts.tobytes(), repr(run.stats)

    alone = []
    for one, how in asked:
        of_laws._cached_laws.cache_clear()
        alone.append(result(one, how))
    for i in rng.integers(0, len(asked), 30).tolist():
        assert result(*asked[i]) == alone[i]
