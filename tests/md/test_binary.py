"""One isolated contact: closed forms, integration, the inverse, the rule made from a law."""

import contextlib
import json
import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from granular import binary

pytestmark = pytest.mark.core
ROWS = json.loads((Path(__file__).parents[1] / "reference/catalogue.json").read_text())["rows"]
UNIT = gr.Pair(m_eff=1.0, r_eff=1.0, index=0)


@pytest.mark.parametrize(("zeta", "eps"), [(float(z), e) for z, e in ROWS["C1"]["numbers"].items()])
def test_dashpot_restitution(zeta, eps):
    law = gr.LinearDashpot(4.0, 4.0 * zeta)  # ω0 = 2
    assert binary.collision(law, UNIT, 3.0).restitution == pytest.approx(eps, rel=1e-12)
    assert binary.restitution(law, UNIT, 3.0) == pytest.approx(eps, rel=1e-12)


def test_hertz_closed_form():
    contact, numbers = binary.collision(gr.Hertz(1.0), UNIT, 1.0), ROWS["C2"]["numbers"]
    assert contact.duration == pytest.approx(numbers["tc_pref"], rel=1e-12)
    assert contact.xi_max == pytest.approx(numbers["xmax_pref"], rel=1e-12)
    assert contact.duration / contact.xi_max == pytest.approx(numbers["tcv_over_x"], rel=1e-12)
    assert binary.collision(gr.Hertz(1.0), UNIT, 32.0).duration == pytest.approx(0.5 * contact.duration, rel=1e-12)


@pytest.mark.parametrize("n", [2, 3])
def test_power_law_closed_form(n):
    contact = binary.collision(gr.PowerLaw(1.0, float(n)), UNIT, 1.0)
    assert contact.duration / contact.xi_max == pytest.approx(ROWS["C2b"]["numbers"][f"n{n}"], rel=1e-12)
    assert contact.xi_max == pytest.approx((0.5 * (n + 1)) ** (1.0 / (n + 1)), rel=1e-12)


def test_walton_braun():
    contact = binary.collision(gr.WaltonBraun(1.0, 4.0), UNIT, 1.0)
    assert contact.restitution == pytest.approx(ROWS["C6"]["numbers"]["eps4"], rel=1e-11)
    assert contact.duration == pytest.approx(ROWS["C6"]["numbers"]["tc4"], rel=1e-11)


@pytest.mark.parametrize("seed", range(5))
def test_walton_braun_in_closed_form_is_what_its_run_gives(seed):
    random = np.random.default_rng(seed)
    k = 10.0 ** random.uniform(1.0, 9.0)
    law = gr.WaltonBraun.from_restitution(random.uniform(0.05, 1.0), k)
    pair = replace(UNIT, m_eff=10.0 ** random.uniform(-4.0, 2.0))
    v = 10.0 ** random.uniform(-4.0, 3.0)

    class Own(gr.WaltonBraun):
        """One that may do anything: it is run."""

    closed, run = (asdict(binary.collision(one, pair, v)) for one in (law, Own(law.k_load, law.k_unload)))
    assert closed == pytest.approx(run, rel=1e-11, abs=1e-13 * closed["xi_max"])
    assert binary.restitution(law, pair, v) == closed["restitution"]
    assert isinstance(gr.restitution_of(law, gr.scenes.three_balls()), gr.ConstantRestitution)


@dataclass(frozen=True)
class Plain:
    """A law that says nothing of itself but its force."""

    law: object

    def force(self, xi, xi_dot, pair):
        return self.law.force(xi, xi_dot, pair)


@pytest.mark.parametrize(
    "law", [gr.LinearDashpot(2.0, 0.3), gr.LinearDashpot(2.0, 5.0), gr.Hertz(3.0), gr.PowerLaw(1.0, 2.0)], ids=repr
)
def test_integration_agrees_with_closed_forms(law):
    closed, integrated = (binary.collision(one, UNIT, 1.5) for one in (law, Plain(law)))
    for name in ("restitution", "duration", "xi_max"):
        assert getattr(integrated, name) == pytest.approx(getattr(closed, name), rel=1e-13)
    assert integrated.force_max == pytest.approx(closed.force_max, rel=1e-12)
    assert integrated.xi_end == pytest.approx(closed.xi_end, abs=1e-13)


@pytest.mark.parametrize(("law", "eps"), [(gr.ViscoelasticHertz(1.0, 0.5), 0.5952515011351346),
                                          (gr.ViscoelasticHertz(1.0, 1.0), 0.39393060322987294)])
def test_viscoelastic_restitution_by_both_ways(law, eps):
    assert binary.collision(law, UNIT, 1.0).restitution == pytest.approx(eps, rel=1e-13)
    assert binary.restitution(law, UNIT, 1.0) == pytest.approx(eps, rel=1e-13)


def test_tsuji_maps_onto_the_dashpot():
    for alpha in (0.05, 0.5, 3.0):
        mapped = binary.restitution(gr.TsujiHertz(1e3, alpha), UNIT, 0.7)
        assert binary.collision(gr.TsujiHertz(1e3, alpha), UNIT, 0.7).restitution == pytest.approx(mapped, rel=1e-13)


@pytest.mark.rotating
def test_inverse_for_every_law_with_damping():
    @dataclass(frozen=True)
    class Own:
        k: float
        gamma: float

        def force(self, xi, xi_dot, pair):
            return self.k * xi + self.gamma * math.sqrt(xi) * xi_dot

    for law, speed in ((gr.LinearDashpot(5e7), 1.0), (gr.ViscoelasticHertz(1e7, 0.0), 3.0), (Own(5e4, 1.0), 2.0)):
        fitted = binary.with_restitution(law, 0.7, UNIT, speed)
        assert binary.restitution(fitted, UNIT, speed) == pytest.approx(0.7, rel=1e-9)
    assert binary.with_restitution(gr.LinearDashpot(5e7), 0.7, UNIT).gamma == pytest.approx(
        gr.LinearDashpot.from_restitution(0.7, 5e7, UNIT).gamma, rel=1e-12
    )


@pytest.mark.rotating
def test_inverse_of_restitution_1_is_tried():
    @dataclass(frozen=True)
    class Twice:
        one: float
        other: float

        def force(self, xi, xi_dot, pair):
            return 1e4 * xi + (self.one + self.other) * math.sqrt(xi) * xi_dot

    for law, field in ((gr.TsujiHertz(1e7, 0.3), "alpha"), (gr.ViscoelasticHertz(1e7, 9.0), "gamma"),
                       (Twice(9.0, 0.0), "one")):
        assert binary.with_restitution(law, 1.0, UNIT, field=field) == replace(law, **{field: 0.0})
    with pytest.raises(ValueError, match=r"`target` must be a restitution that `one` can reach at 1\.0 m/s, got "
                                         r"1\.0\."):
        binary.with_restitution(Twice(9.0, 9.0), 1.0, UNIT, field="one")


def test_inverse_refuses_what_cannot_be():
    with pytest.raises(ValueError, match=r"`field` must be a field of LinearDashpot, got 'zeta'\. Name the damping "
                                         r"of the law\."):
        binary.with_restitution(gr.LinearDashpot(1.0), 0.5, UNIT, field="zeta")
    with pytest.raises(ValueError, match=r"`target` must be a number in \(0, 1\], got 1\.2\."):
        binary.with_restitution(gr.LinearDashpot(1.0), 1.2, UNIT)


def test_rule_of_a_law():
    scene = gr.scenes.three_balls()
    laws = [gr.LinearDashpot.from_restitution(0.7, 5e7, pair) for pair in scene.pairs]
    rule = gr.restitution_of(laws)
    assert [rule(2.0, pair) for pair in scene.pairs] == pytest.approx([0.7, 0.7], rel=1e-14)
    assert isinstance(gr.restitution_of(laws, scene), gr.ConstantRestitution)
    slower = gr.restitution_of(gr.ViscoelasticHertz(1e7, 5e2), scene)
    assert slower(0.1, scene.pairs[0]) > slower(10.0, scene.pairs[0])


@pytest.mark.parametrize("speed", [0.0, -1.0, math.nan])
def test_impact_speed_must_be_positive(speed):
    with pytest.raises(ValueError, match=r"`speed` must be a finite number above 0, got (0\.0|-1\.0|nan)\."):
        binary.collision(gr.Hertz(1.0), UNIT, speed)


@pytest.mark.parametrize("law", [gr.LinearDashpot(1e5, 30.0), gr.ViscoelasticHertz(1e7, 1e3), gr.WaltonBraun(1e5, 2e5)])
def test_restitution_of_many_speeds_is_that_of_each(law):
    speeds = np.geomspace(1e-3, 1e2, 6).reshape(2, 3)
    many = binary.restitution(law, UNIT, speeds)
    assert many.shape == speeds.shape
    assert many.tolist() == [[binary.restitution(law, UNIT, v) for v in row] for row in speeds.tolist()]
    assert isinstance(binary.restitution(law, UNIT, 1.0), float)


@pytest.mark.parametrize("law", [
    gr.ViscoelasticHertz(1e9, 1e3), gr.TsujiHertz(1e9, 0.3), gr.Hertz(1e9), gr.WaltonBraun(1e7, 2e7),
    gr.LinearDashpot(1e7, 10.0),
])
def test_restitution_never_exceeds_one_whatever_the_speed(law):
    for exponent in range(-300, 301, 60):
        for ask in (lambda v: binary.collision(law, UNIT, v).restitution, lambda v: binary.restitution(law, UNIT, v)):
            with contextlib.suppress(OutOfRange):
                assert 0.0 < sentence(ask, 10.0**exponent) <= 1.0


class OutOfRange(Exception):
    pass


def sentence(ask, speed):
    """What `ask` gives, or `OutOfRange` if it says that numbers end there; any other error is one."""
    try:
        return ask(speed)
    except ValueError as refused:
        if "within the range of floating-point numbers" in str(refused):
            raise OutOfRange from None
        raise


@pytest.mark.parametrize("laws", [3.0, None, (), "dashpot"])
def test_a_rule_of_laws_needs_laws(laws):
    with pytest.raises(TypeError, match="`laws` must be a tuple of force laws, one for all or one per pair, got "
                                        f"{laws!r}".replace("()", r"\(\)")):
        gr.binary.LawRestitution(laws)
