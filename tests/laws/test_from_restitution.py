"""Laws with a given restitution and contact duration."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import granular as gr
from granular.laws import dashpot, viscoelastic_restitution
from granular.laws.hertz import _tsuji_duration

mpmath = pytest.importorskip("mpmath")
MP = mpmath.MPContext()
MP.dps = 30
PAIR = gr.Pair(m_eff=0.3, r_eff=0.02, index=0)


def drawn(seed, count, low, high):
    """Restitutions of both ends of [low, high], with durations, masses and speeds of many magnitudes."""
    random = np.random.default_rng(seed)
    for i in range(count):
        eps = low ** random.uniform() if i % 2 else 1.0 - (1.0 - high) ** random.uniform()
        pair = gr.Pair(m_eff=10.0 ** random.uniform(-9, 6), r_eff=0.1, index=0)
        yield float(eps), float(10.0 ** random.uniform(-8, 3)), pair, float(10.0 ** random.uniform(-4, 3))


def test_the_dashpot_has_the_restitution_and_the_duration():
    law = gr.LinearDashpot.from_restitution(0.75, duration=0.1, pair=PAIR)
    hit = gr.binary.collision(law, PAIR, 1.0)
    assert (hit.restitution, hit.duration) == (pytest.approx(0.75, rel=1e-14), pytest.approx(0.1, rel=1e-14))
    # the common formula, whose force pulls at the end, gives another contact
    log = math.log(0.75)
    omega = math.sqrt(math.pi**2 + log**2) / 0.1
    common = gr.LinearDashpot(PAIR.m_eff * omega**2, -2.0 * PAIR.m_eff * log / 0.1)
    hit = gr.binary.collision(common, PAIR, 1.0)
    assert (round(hit.restitution, 3), round(hit.duration, 3)) == (0.763, 0.094)


def test_dashpots_of_the_whole_range():
    for eps, duration, pair, speed in drawn(1, 400, 1e-6, 1.0 - 1e-15):
        law = gr.LinearDashpot.from_restitution(eps, duration=duration, pair=pair)
        hit = gr.binary.collision(law, pair, speed)
        assert hit.duration == pytest.approx(duration, rel=1e-14)
        assert hit.restitution == pytest.approx(eps, rel=0.0, abs=1e-14)
        again = gr.LinearDashpot.from_restitution(eps, law.k, pair)
        assert again.gamma == pytest.approx(law.gamma, rel=1e-14)


@pytest.mark.parametrize("eps", [1.0, 0.999999, 0.9, 0.5, math.exp(-2.0), 0.1, 1e-3, 1e-6])
def test_the_dashpot_is_the_solution_in_thirty_digits(eps):
    law = gr.LinearDashpot.from_restitution(eps, duration=0.02, pair=PAIR)
    k, lam = MP.mpf(law.k) / PAIR.m_eff, MP.mpf(law.gamma) / (2 * MP.mpf(PAIR.m_eff))
    w = MP.sqrt(MP.mpc(k - lam * lam))

    def state(t):
        xi = MP.re(MP.exp(-lam * t) * MP.sin(w * t) / w)
        return xi, MP.re(MP.exp(-lam * t) * (MP.cos(w * t) - lam * MP.sin(w * t) / w))

    def force(t):
        xi, rate = state(t)
        return k * xi + 2 * lam * rate

    low, high = MP.mpf("0.019"), MP.mpf("0.021")
    assert force(low) > 0 > force(high)
    for _ in range(90):
        middle = (low + high) / 2
        low, high = (middle, high) if force(middle) > 0 else (low, middle)
    # the end of a contact is as uncertain as rounding of k and γ, which counts twice for strong damping
    assert abs(low / MP.mpf(0.02) - 1) <= 1e-14
    assert abs(-state(low)[1] - MP.mpf(eps)) <= 1e-14


def tsuji_duration(zeta):
    """Duration of an isolated contact for k = m_eff = v = 1, in 30 digits."""
    z = MP.mpf(zeta)
    w = MP.sqrt(MP.mpc(1 - z * z))
    end = MP.re(2 * MP.acos(MP.mpc(z)) / w) if zeta != 1.0 else MP.mpf(2)

    def s(t):
        return MP.re(MP.exp(-z * t) * (MP.sin(w * t) / w if zeta != 1.0 else t))

    # tanh-sinh quadrature, on panels that become shorter towards the zero of s beyond the end
    panels = [end - end / 2**i for i in (1, 2, 4, 6, 10, 16, 24, 32, 48)] if zeta > 0.0 else [end / 2]
    whole = MP.quad(lambda r: 5 * r**4 * s(r**5) ** MP.mpf(-0.2) if r > 0 else MP.mpf(0), [0, (end / 2) ** MP.mpf(0.2)])
    whole += MP.quad(lambda t: s(t) ** (-MP.mpf(1) / 5) if s(t) > 0 else MP.mpf(0), [*panels, end])
    return float((MP.mpf(4) / 5) ** (MP.mpf(3) / 5) * whole)


@pytest.mark.rotating
@pytest.mark.parametrize(
    "zeta", [0.0, 1e-12, 1e-5, 0.01, 0.2, 0.2999, 0.3, 0.8, 1.0 - 1e-14, 1.0, 1.0 + 1e-13, 3.0, 496.0])
def test_duration_under_tsuji_damping(zeta):
    assert _tsuji_duration(zeta) == pytest.approx(tsuji_duration(zeta), rel=3e-14)


def test_durations_at_both_ends():
    assert _tsuji_duration(0.0) == pytest.approx(viscoelastic_restitution.duration(0.0), rel=2e-14)
    strong = dashpot.damping_ratio(1e-6)
    assert _tsuji_duration(strong) < _tsuji_duration(0.5 * strong) < _tsuji_duration(1.0)


def of_both_kinds(eps, duration, pair, speed):
    return (gr.TsujiHertz.from_restitution(eps, duration=duration, speed=speed, pair=pair),
            gr.ViscoelasticHertz.from_restitution(eps, speed, duration=duration, pair=pair))


@pytest.mark.rotating
def test_hertz_laws_have_the_restitution_and_the_duration():
    # nearer to ε = 1 the engine ends a contact under Tsuji damping while a force below rounding is left
    for eps, duration, pair, speed in drawn(2, 60, 1e-6, 0.999):
        for law in of_both_kinds(eps, duration, pair, speed):
            hit = gr.binary.collision(law, pair, speed)
            # the engine resolves speeds to rounding of the impact speed, and the end of a contact by these speeds
            assert hit.duration == pytest.approx(duration, rel=1e-12 + 1e-15 / eps)
            assert hit.restitution == pytest.approx(eps, rel=0.0, abs=1e-12)


@pytest.mark.rotating
@pytest.mark.parametrize("eps", [1.0, 0.9, 0.5, 0.1])
def test_hertz_laws_solved_by_scipy(eps):
    speed, duration = 0.7, 2e-3
    for law in of_both_kinds(eps, duration, PAIR, speed):
        def slope(r, y, law=law):
            # t = r^4 in units of the duration: the solution is smooth at the onset
            force = law.force(max(y[0], 0.0), y[1], PAIR)
            return np.array([y[1], -force / PAIR.m_eff]) * 4.0 * r**3 * duration

        def end(r, y, law=law):
            return law.force(max(y[0], 1e-300), y[1], PAIR) if r > 0.5 else 1.0

        end.terminal, end.direction = True, -1.0
        found = solve_ivp(slope, (0.0, 1.1), [0.0, speed], "DOP853", rtol=3e-14, atol=1e-18, max_step=2e-3,
                          events=end if eps < 1.0 else lambda r, y: y[0] if r > 0.5 else 1.0)
        assert found.t_events[0][0] ** 4 == pytest.approx(1.0, rel=1e-12)
        assert -found.y_events[0][0][1] / speed == pytest.approx(eps, rel=1e-12)


def test_laws_of_a_stiffness_stay_as_they_were():
    for eps in (0.2, 0.9, 1.0):
        tsuji, viscoelastic = of_both_kinds(eps, 1e-3, PAIR, 2.0)
        assert gr.TsujiHertz.from_restitution(eps, tsuji.k) == tsuji
        again = gr.ViscoelasticHertz.from_restitution(eps, 2.0, viscoelastic.k, PAIR)
        assert again.gamma == pytest.approx(viscoelastic.gamma, rel=1e-14)


BOTH = r"Exactly one of `k` and `duration` must be given, got k = 1\.0 and duration = 0\.1\. Restitution and " \
    r"duration determine the stiffness: omit `k`\."
NEITHER = r"Exactly one of `k` and `duration` must be given, got neither\. Give the stiffness or the contact duration\."
ZERO = r"`restitution` must be a number in \(0, 1\], got 0\.0\. A contact without rebound never ends\. Give a small " \
    r"restitution, such as 0\.01\."
MAKERS = {
    "dashpot": lambda eps, **more: gr.LinearDashpot.from_restitution(eps, pair=PAIR, **more),
    "tsuji": lambda eps, **more: gr.TsujiHertz.from_restitution(eps, pair=PAIR, speed=1.0, **more),
    "viscoelastic": lambda eps, **more: gr.ViscoelasticHertz.from_restitution(eps, 1.0, pair=PAIR, **more),
}


@pytest.mark.parametrize("make", MAKERS.values(), ids=MAKERS)
@pytest.mark.parametrize(("eps", "more", "message"), [
    (0.5, {"k": 1.0, "duration": 0.1}, BOTH), (0.5, {}, NEITHER), (0.0, {"duration": 0.1}, ZERO),
    (0.0, {"k": 1.0}, ZERO), (0.5, {"duration": 0.0}, r"`duration` must be a finite number above 0, got 0\.0\."),
])
def test_misuse_is_one_sentence_with_the_fix(make, eps, more, message):
    with pytest.raises(ValueError, match=f"^{message}$"):
        make(eps, **more)


def test_the_pair_and_the_speed_are_required():
    with pytest.raises(TypeError, match=r"`pair` must be a Pair, such as scene\.pairs\[0\], got None\."):
        gr.LinearDashpot.from_restitution(0.5, duration=0.1)
    with pytest.raises(TypeError, match=r"`speed` must be a single number, got None\."):
        gr.TsujiHertz.from_restitution(0.5, duration=0.1, pair=PAIR)


def test_files_can_state_the_duration(tmp_path):
    path = tmp_path / "own.toml"
    path.write_text("[scene]\nmass = [inf, 1.0]\nradius = [0.0, 0.1]\ngap = [1.0]\nvelocity = [0.0, 0.0]\n"
                    "gravity = 9.81\n[law]\ntype = \"LinearDashpot\"\nrestitution = 0.75\nduration = 0.1\n")
    case = gr.cases.load(path)
    assert case.law == (gr.LinearDashpot.from_restitution(0.75, duration=0.1, pair=case.scene.pairs[0]),)
    assert case.rule == gr.ConstantRestitution(0.75)
