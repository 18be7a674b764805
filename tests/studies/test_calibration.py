"""Numbers of a law from measurements, as the notebook on calibration finds them: error bars mean what they say."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

import granular as gr

scipy = pytest.importorskip("scipy")
NOTEBOOK = Path(__file__).parents[2] / "docs" / "notebooks" / "calibration.ipynb"


@pytest.fixture(scope="module")
def notebook():
    """The functions and constants of the notebook's cells up to the fit, without the lines that use them."""
    stored = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    cells = ["".join(line for line in cell["source"] if "plt." not in line and "pyplot" not in line)
             for cell in stored if cell["cell_type"] == "code"]
    names: dict = {}
    for cell, using in ((cells[0], "heard, measured"), (cells[2], "for model in")):
        exec(cell.partition(f"\n{using}")[0], names)
    return names


def inside(estimates, errors, truth) -> float:
    """The share of estimates within one error of the truth."""
    return float((np.abs(np.array(estimates) - truth) < np.array(errors)).mean())


def test_of_200_laws_from_the_restitution_at_twelve_speeds_the_truth_is_within_one_sigma():
    from scipy.optimize import curve_fit

    scene = gr.scenes.bouncing_ball(radius=0.01)
    pair, k, noise = scene.pairs[0], 1e9, 0.005
    truth = gr.ViscoelasticHertz.from_restitution(0.8, 1.0, k, pair).gamma
    speed, rng, found = np.linspace(0.1, 4.0, 12), np.random.default_rng(12), []

    def model(v, log_gamma):
        return gr.binary.restitution(gr.ViscoelasticHertz(k, math.exp(log_gamma)), pair, v)

    exact = model(speed, math.log(truth))
    for _ in range(200):
        (value,), covariance = curve_fit(model, speed, exact + rng.normal(0.0, noise, 12), math.log(truth) - 0.1,
                                         sigma=np.full(12, noise), absolute_sigma=True)
        found.append((value, math.sqrt(covariance[0, 0])))
    assert 0.58 <= inside(*np.transpose(found), math.log(truth)) <= 0.78


@pytest.mark.parametrize("law", [gr.LinearDashpot(4e4, 5.0), gr.TsujiHertz(1e6, 0.1), gr.ViscoelasticHertz(1e8, 1e4)])
def test_restitutions_know_one_combination_of_stiffness_and_damping(law):
    """The singular value of the other is 0, and matched stiffnesses differ in duration alone."""
    pair, speed, step = gr.scenes.bouncing_ball().pairs[0], np.linspace(0.3, 3.0, 5), 1e-3
    damping = "alpha" if isinstance(law, gr.TsujiHertz) else "gamma"
    power = {gr.LinearDashpot: 0.5, gr.TsujiHertz: 0.0, gr.ViscoelasticHertz: 0.6}[type(law)]

    def scaled(log_k, log_damping):
        return type(law)(law.k * math.exp(log_k), **{damping: getattr(law, damping) * math.exp(log_damping)})

    slopes = [(gr.binary.restitution(scaled(*d), pair, speed) - gr.binary.restitution(scaled(*-d), pair, speed))
              for d in step * np.eye(2)]
    singular = np.linalg.svd(np.transpose(slopes) / (2.0 * step), compute_uv=False)
    assert singular[0] > 1e-3
    assert singular[1] < 1e-6 * singular[0]
    one, other = (gr.binary.collision(scaled(x, power * x), pair, 1.0) for x in (0.0, math.log(100.0)))
    assert one.restitution == pytest.approx(other.restitution, rel=1e-12)
    assert one.duration > 5.0 * other.duration


def test_a_recording_gives_restitution_and_stiffness(notebook):
    """Two of the 200 below; isolated contacts between flights do not fit."""
    rng = np.random.default_rng(31)
    for _ in range(2):
        heard, measured = notebook["record"](rng)
        found = notebook["fit"](notebook["knocks"], heard, measured)
        assert found.probability > 1e-3
        for name, truth in (("eps", 0.8), ("log_k", math.log(4e4))):
            assert abs(found.value[name] - truth) < 3.5 * found.error[name]
    assert notebook["fit"](notebook["flights"], heard, measured).chi2 > 200.0


@pytest.mark.soak
def test_of_200_recordings_the_truth_is_within_one_sigma(notebook):
    rng, found = np.random.default_rng(0), []
    for _ in range(200):
        found.append(notebook["fit"](notebook["knocks"], *notebook["record"](rng)))
    for name, truth, said in (("eps", 0.8, 140), ("log_k", math.log(4e4), 136)):
        share = inside([fit.value[name] for fit in found], [fit.error[name] for fit in found], truth)
        assert 0.58 <= share <= 0.78
        assert abs(200 * share - said) <= 1, "the notebook says another number"
    assert np.mean([fit.chi2 for fit in found]) == pytest.approx(7.0, abs=4.0 * math.sqrt(14.0 / 200.0))
