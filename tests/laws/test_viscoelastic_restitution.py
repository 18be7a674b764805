"""The tabulated viscoelastic collision against independent solutions of its equation."""

from __future__ import annotations

import importlib.util
import json
import math
import random
from itertools import pairwise
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import granular as gr
from granular._engine.kernels import compiled, have_numba
from granular.laws.viscoelastic_restitution import (
    PADE_B4,
    PADE_C1,
    Q_END,
    SERIES_TERMS,
    damping,
    duration,
    peaks,
    restitution,
    restitution_pade,
    restitution_series,
)

ROOT = Path(__file__).parents[2]
KNOWN: dict[str, Any] = json.loads((ROOT / "tests" / "reference" / "viscoelastic.json").read_text())
WEAK_TO_STRONG = [10.0**e for e in np.linspace(-12, 15, 300)]
B_END = math.expm1(Q_END * Q_END)


@pytest.fixture(scope="module")
def generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("generator", ROOT / "bench" / "make_viscoelastic_table.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("row", KNOWN["solutions"], ids=lambda row: f"b={row['b']:.3g}")
def test_thirty_digit_solutions(row: dict[str, Any]) -> None:
    b, eps, t_c = row["b"], float(row["eps"]), float(row["duration"])
    assert restitution(b) == pytest.approx(eps, rel=2e-15 + 3e-16 * -math.log(eps), abs=0.0)
    assert duration(b) == pytest.approx(t_c, rel=3e-15, abs=0.0)


@pytest.mark.parametrize("row", KNOWN["solutions"], ids=lambda row: f"b={row['b']:.3g}")
def test_damping_is_as_right_as_its_argument(row: dict[str, Any]) -> None:
    b, eps = row["b"], float(row["eps"])
    step = max(1e-6 * b, 1e-300)
    condition = eps / abs(restitution(b + step) - restitution(b - step)) * 2 * step / b  # d ln b / d ln eps
    assert damping(eps) == pytest.approx(b, rel=2e-16 * condition + 1e-14, abs=0.0)


def test_the_generator_still_makes_these_numbers(generator: ModuleType) -> None:
    with generator.mp.workdps(30):
        eps, t_c = generator.collide(generator.mp.sqrt(0.7), digits=18)
    assert restitution(0.7) == pytest.approx(float(eps), rel=1e-15, abs=0.0)
    assert duration(0.7) == pytest.approx(float(t_c), rel=1e-15, abs=0.0)


def test_ends() -> None:
    assert restitution(0.0) == 1.0
    assert damping(1.0) == 0.0
    assert restitution(1e300) == 0.0
    elastic = 2.0 * 1.25**0.4 * math.sqrt(math.pi) * math.gamma(1.4) / math.gamma(0.9)
    assert duration(0.0) == pytest.approx(elastic, rel=4e-15, abs=0.0)
    for f in (restitution, duration):  # table and asymptote meet
        assert f(B_END * (1 - 1e-15)) == pytest.approx(f(B_END * (1 + 1e-15)), rel=2e-14, abs=0.0)


def test_both_fall_with_damping() -> None:
    for f in (restitution, duration):
        values = [f(b) for b in [0.0, *WEAK_TO_STRONG]]
        assert all(later <= earlier for earlier, later in pairwise(values))


@given(st.floats(1e-300, 1.0))
def test_damping_inverts_restitution(eps: float) -> None:
    assert restitution(damping(eps)) == pytest.approx(eps, rel=2e-15 + 2e-15 * -math.log(eps), abs=0.0)


def test_no_digits_are_lost_near_elastic() -> None:
    for loss in (1e-3, 1e-6, 1e-9, 1e-12, 1e-15):
        eps = 1.0 - loss
        lost = 1.0 - eps  # exactly
        h2, h4, h5 = SERIES_TERMS[2], SERIES_TERMS[4], SERIES_TERMS[5]
        b = damping(eps)
        assert -(h2 * b + h4 * b * b + h5 * b * b * math.sqrt(b)) == pytest.approx(lost, rel=b * b + 1e-15, abs=0.0)


def test_series_coefficients() -> None:
    h2 = -math.sqrt(math.pi) * math.gamma(0.6) / (2**0.2 * 5**0.4 * math.gamma(2.1))
    assert pytest.approx([1.0, 0.0, h2, 0.0, 0.6 * h2 * h2, 4.0 / 15.0], rel=4e-15, abs=1e-25) == SERIES_TERMS[:6]
    for h, row in zip(SERIES_TERMS, KNOWN["series"], strict=True):
        assert h == pytest.approx(row["h"], rel=0.0, abs=row["uncertainty"])


def test_series_and_table_agree_where_the_series_converges() -> None:
    for b in (0.0, 1e-8, 1e-3, 0.05):
        assert restitution_series(b, order=20) == pytest.approx(restitution(b), rel=3e-14, abs=0.0)


@pytest.mark.parametrize(("order", "b"), [(5, 0.117), (10, 0.356), (20, 0.760)])
def test_series_errs_by_what_its_docstring_says(order: int, b: float) -> None:
    assert abs(restitution_series(b, order) - restitution(b)) == pytest.approx(1e-3, rel=0.02)


def test_pade_errs_by_what_its_docstring_says() -> None:
    errors = [restitution_pade(b) - restitution(b) for b in WEAK_TO_STRONG]
    assert min(errors) > -1e-15
    assert max(errors) <= restitution_pade(3.013) - restitution(3.013) == pytest.approx(8.6423e-3, rel=1e-4)
    assert pytest.approx([KNOWN["pade"]["c1"], KNOWN["pade"]["b4"]], rel=1e-14, abs=0.0) == [PADE_C1, PADE_B4]
    assert restitution_pade(0.5) == pytest.approx(KNOWN["pade"]["value_at_half"], rel=1e-14, abs=0.0)
    for b, ratio in ((1.0, 1.012), (10.0, 1.20), (1e4, 3.36)):
        assert restitution_pade(b) / restitution(b) == pytest.approx(ratio, rel=5e-3)


@pytest.mark.skipif(not have_numba(), reason="numba is not installed")
@pytest.mark.parametrize("function", [restitution, duration])
def test_compiled_gives_the_same_bits(function: Any) -> None:
    rng = random.Random(1)
    fast = compiled(function)
    for b in [0.0, *WEAK_TO_STRONG, *(10.0 ** rng.uniform(-12, 12) for _ in range(2000))]:
        assert fast(b) == function(b)


@pytest.mark.parametrize("eps", [0.0, -0.1, 1.1, math.nan])
def test_impossible_restitution(eps: float) -> None:
    with pytest.raises(ValueError, match=r"`restitution` must be a number in \(0, 1\], got .*"):
        damping(eps)


def test_impossible_arguments_of_the_approximations() -> None:
    with pytest.raises(ValueError, match=r"`order` must be an integer from 0 to 20, got 21"):
        restitution_series(0.1, 21)
    with pytest.raises(ValueError, match=r"`b` must be a finite number of at least 0, got -1\.0"):
        restitution_pade(-1.0)


def test_peaks_are_those_of_the_contact_itself():
    """Largest overlap and force, beside the contact solved by pieces; and where the table ends."""
    rng = random.Random(7)
    pair = gr.Pair(m_eff=1.0, r_eff=1.0, index=0)
    for _ in range(12):
        b = 10.0 ** rng.uniform(-6, 0.5)
        run = gr.binary.collision(gr.ViscoelasticHertz(1.0, b), pair, 1.0)
        assert peaks(b) == pytest.approx((run.xi_max, run.force_max), rel=2e-13)
    assert peaks(0.0) == pytest.approx((1.25**0.4, 1.25**0.6), rel=4e-16)
    near, beyond = math.expm1(24.999), math.expm1(25.001)
    ratio = (beyond / near) ** (2.0 / 3.0)
    assert peaks(beyond) == pytest.approx((peaks(near)[0] / ratio, peaks(near)[1] * ratio), rel=1e-13)
