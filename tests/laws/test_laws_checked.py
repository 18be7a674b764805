"""A law of one's own that gives no numbers, stops nothing or contradicts its traits: a sentence, no endless run."""

import math
import re
from dataclasses import dataclass, field

import pytest
from scipy.integrate import quad

from granular import binary, md
from granular.cases.scenes import three_balls
from granular.laws import Hertz
from granular.scene import Scene

STACK = three_balls(gap=1e-3)
PAIR = STACK.pairs[1]


def law(force, **traits):
    """Return a law with this force and these traits."""
    members = {"force": lambda self, xi, xi_dot, pair: force(xi, xi_dot), "__repr__": lambda self: "Own()"}
    return type("Own", (), members | traits)()


RUNS = {
    "located": lambda one: md.simulate(STACK, one, t_end=0.1),
    "fixed": lambda one: md.simulate(STACK, one, t_end=0.1, dt=1e-4),
    "default step": lambda one: md.simulate(STACK, one, t_end=0.1, method="verlet"),
    "binary": lambda one: binary.collision(one, PAIR, 1.0),
    "rule": lambda one: binary.restitution_of(one)(1.0, PAIR),
}

NO_NUMBERS = {
    "nan": (lambda xi, v: math.nan, "nan"),
    "inf": (lambda xi, v: math.inf, "inf"),
    "nothing": (lambda xi, v: None, "None"),
    "word": (lambda xi, v: "a", "'a'"),
    "list": (lambda xi, v: [1.0], r"\[1\.0\]"),
    "nan when deep": (lambda xi, v: 1e8 * xi**1.5 if xi < 1e-5 else math.nan, "nan"),
    "nan when parting": (lambda xi, v: 1e8 * xi**1.5 if v >= 0.0 else math.nan, "nan"),
}


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("case", NO_NUMBERS)
def test_force_that_is_no_number(case, run) -> None:
    force, shown = NO_NUMBERS[case]
    sentence = (r"The law of pair \S+, Own\(\), must return a finite force in N, got "
                rf"{shown} at overlap ξ = \S+ m and rate ξ̇ = \S+ m/s\.$")
    with pytest.raises(ValueError, match=sentence):
        RUNS[run](law(force))


@pytest.mark.parametrize("depth", [0.5, 0.8, 0.99])
def test_force_that_is_no_number_only_at_the_deepest(depth) -> None:
    deepest = depth * binary.collision(Hertz(1e8), PAIR, 1.0).xi_max
    own = law(lambda xi, v: 1e8 * math.pow(xi, 1.5) if xi < deepest else math.nan)
    with pytest.raises(ValueError, match=r"a finite force in N, got nan at overlap ξ = \S+ m and rate ξ̇ = \S+ m/s\."):
        binary.collision(own, PAIR, 1.0)


def test_force_that_is_no_number_beyond_what_was_expected() -> None:
    scene = Scene([1.0, 1.0], [0.1, 0.1], [1e-4], [1.0, -1.0])
    deepest = 0.9 * md.simulate(scene, Hertz(1e8), t_end=0.02, dt=1e-6).contacts["xi_max"].max()
    own = law(lambda xi, v: 1e8 * math.pow(xi, 1.5) if xi < deepest else math.nan)
    with pytest.raises(ValueError, match=r"The law of pair 0–1, Own\(\), must return a finite force in N, got nan at "
                                         r"overlap ξ = 0\.000819816 m and rate ξ̇ = 0 m/s\."):
        md.simulate(scene, own, t_end=0.02, dt=1e-6)


@pytest.mark.rotating
@pytest.mark.parametrize("force", [lambda xi, v: 0.0 if xi > -1.0 else 1.0, lambda xi, v: -1e6 * xi * xi])
def test_law_that_stops_nothing(force) -> None:
    with pytest.raises(ValueError, match="pass through each other"):
        binary.collision(law(force), PAIR, 1.0)


GAINS = {
    "negative dashpot": lambda xi, v: 5e7 * xi - 100.0 * v,
    "harder on the way out": lambda xi, v: 5e7 * xi * (1.0 if v > 0.0 else 1.5),
    "negative damping of a sphere": lambda xi, v: math.sqrt(xi) * (1e9 * xi - 10.0 * v),
}


@pytest.mark.parametrize("run", RUNS)
@pytest.mark.parametrize("case", GAINS)
def test_law_that_gains_energy(case, run) -> None:
    sentence = (r"The law of pair \S+, Own\(\), must not gain energy, got \S+ N while the bodies separate and \S+ N "
                r"while they approach, at overlap ξ = \S+ m and \S+ m/s\. Damping must not be negative\.$")
    with pytest.raises(ValueError, match=sentence):
        RUNS[run](law(GAINS[case]))


def test_trait_that_says_negative_damping() -> None:
    negative = law(lambda xi, v: 5e7 * xi - 100.0 * v, linear=lambda self, pair: (5e7, -100.0))
    with pytest.raises(ValueError, match=r"The law of pair floor–1, Own\(\), must not gain energy, got 2\.50001e\+07 N "
                                         r"while the bodies separate and 2\.49999e\+07 N while they approach, at "
                                         r"overlap ξ = 0\.5 m and 1 m/s\. Damping must not be negative\."):
        md.simulate(STACK, negative, t_end=0.1)


@pytest.mark.rotating
@pytest.mark.parametrize("force", [
    lambda xi, v: 5e7 * (xi - 1e-5),  # sets in late
    lambda xi, v: 5e7 * xi**1.5 - 100.0 * math.sqrt(xi),  # would pull at first
])
def test_force_that_sets_in_late_is_elastic_all_the_same(force) -> None:
    found = binary.collision(law(force), PAIR, 1.0)
    assert found.restitution == pytest.approx(1.0, abs=1e-12)
    assert 0.5 * PAIR.m_eff == pytest.approx(  # the energy goes into the spring
        quad(lambda xi: max(0.0, force(xi, 0.0)), 0.0, found.xi_max, points=[1e-5], limit=200)[0], rel=1e-6)
    assert binary.restitution_of(law(force))(1.0, PAIR) == pytest.approx(1.0, abs=1e-12)


@dataclass
class Changing:
    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi * (1.0 + xi) + 10.0 * xi_dot


def test_law_that_can_change_is_not_remembered() -> None:
    one = Changing(1e6)
    before = binary.restitution(one, PAIR, 1.0)
    one.k = 1e4
    assert binary.restitution(one, PAIR, 1.0) == binary.restitution(Changing(1e4), PAIR, 1.0) < before


@dataclass(frozen=True)
class Labelled:
    """A law whose damping is left out where laws are compared."""

    k: float
    gamma: float = field(compare=False)

    def force(self, xi, xi_dot, pair):
        return self.k * xi * (1.0 + xi) + self.gamma * xi_dot


def test_laws_that_compare_equal_are_not_taken_for_one_another() -> None:
    weak, strong = Labelled(1e6, 1.0), Labelled(1e6, 100.0)
    assert weak == strong
    assert binary.restitution(strong, PAIR, 1.0) < binary.restitution(weak, PAIR, 1.0) < 1.0


def test_law_of_limited_reach_is_not_refused() -> None:
    exponential = law(lambda xi, v: 1e5 * math.expm1(xi / 1e-6))
    assert binary.collision(exponential, PAIR, 1.0).restitution == pytest.approx(1.0, abs=1e-14)


def test_class_instead_of_law() -> None:
    for act in (*RUNS.values(), lambda one: md.simulate(STACK, [Hertz(1e8), one])):
        with pytest.raises(TypeError, match=r"(The law of pair (floor–1|1–2)|`law`) must be an instance, such as "
                                            r"Hertz\(k=\.\.\.\), got the class Hertz\."):
            act(Hertz)


@dataclass(frozen=True)
class Springy:
    """A spring that is a little stiffer on the way out."""

    k: float
    more: float

    memory = True
    rate_dependent = False

    def force(self, xi, xi_dot, pair, xi_max):
        return self.k * xi * (1.0 + self.more * (xi_max - xi) / xi_max)


@pytest.mark.rotating
def test_rounding_makes_no_restitution_above_one() -> None:
    assert binary.collision(Springy(1e6, 1e-10), PAIR, 1.0).restitution == 1.0
    with pytest.raises(ValueError, match=r"`law` must not gain energy, got Springy\(k=1000000\.0, more=1e-07\)\. "
                                         r"At 1\.0 m/s its restitution is 1\.000000016666666\d\. Its force must not "
                                         r"be larger while the bodies separate than while they approach\."):
        binary.collision(Springy(1e6, 1e-7), PAIR, 1.0)
    stiffening = law(lambda xi, v: 1e8 * xi * (1.0 + 1e4 * xi * xi))
    for k in range(1, 20):
        assert binary.restitution_of(stiffening)(0.37 * k, PAIR) <= 1.0


def test_default_step_of_a_law_without_slope() -> None:
    constant = law(lambda xi, v: 1e3 if xi > 0.0 else 0.0)
    with pytest.raises(ValueError, match=r"`dt` must be given in s, got None\. The duration of a contact does not "
                                         r"follow from Own\(\)\."):
        md.simulate(STACK, constant, t_end=0.1, method="verlet")


@pytest.mark.rotating
@pytest.mark.parametrize("t_end", [None, 1.1, 3.0])
@pytest.mark.parametrize("dt", [None, 1e-5])
def test_soft_spheres_between_walls_that_meet(t_end, dt) -> None:
    press = Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [1.0, 1.0], [1.0, 0.0, -1.0])
    with pytest.raises(ValueError, match=rf"`t_end` must be before the walls meet at t = 1\.1 s, got {t_end}\."):
        md.simulate(press, Hertz(1e8), t_end=t_end, dt=dt)
    assert md.simulate(press, Hertz(1e8), t_end=1.05, dt=dt).gap[-1] == pytest.approx([-0.05, -0.05])


@dataclass(frozen=True)
class Quadratic:
    """F = k ξ², with a potential that may be wrong."""

    k: float = 1e9
    factor: float = 1.0

    def force(self, xi, xi_dot, pair):
        return self.k * xi * xi

    def potential(self, xi, pair):
        return self.factor * self.k * xi**3 / 3.0


def test_potential_that_contradicts_the_force() -> None:
    md.simulate(STACK, Quadratic(), t_end=0.01)
    with pytest.raises(ValueError, match=r"The law of pair floor–1, Quadratic\(k=1000000000\.0, factor=1\.00001\), "
                                         "must have a potential that is the integral of its force, got "
                                         r"6\.447668847321737 J for the potential and 6\.447604371278025 J for the "
                                         r"integral at overlap 0\.00268435 m\. Fix the trait or leave it out\."):
        md.simulate(STACK, Quadratic(factor=1.00001), t_end=0.01)
    with pytest.raises(ValueError, match=r"The law of pair floor–1, WrongSpring\(k=10000000\.0\), must have a "
                                         r"potential that is the integral of its force, got 2500000\.0 J for the "
                                         r"potential and 1250000\.0 J for the integral at overlap 0\.5 m\. Fix the "
                                         r"trait or leave it out\."):
        md.simulate(STACK, WrongSpring(1e7), t_end=0.01)


@dataclass(frozen=True)
class WrongSpring:
    """A spring with twice its energy."""

    k: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi

    def potential(self, xi, pair):
        return self.k * xi * xi


def test_potential_of_a_law_with_a_kink() -> None:
    kink = 3e-6

    def force(xi, v):
        return 1e8 * xi + 1e9 * max(0.0, xi - kink)

    def potential(self, xi, pair):
        return 0.5e8 * xi * xi + 0.5e9 * max(0.0, xi - kink) ** 2

    md.simulate(STACK, law(force, potential=potential), t_end=0.01)


def test_rate_that_is_denied_and_enters() -> None:
    damped = law(lambda xi, v: 1e9 * xi * xi * (1.0 + 0.1 * v), rate_dependent=False)
    dashpot = law(lambda xi, v: 1e7 * xi + 5.0 * v, rate_dependent=False)
    sentence = re.escape(
        "The law of pair floor–1, Own(), must not depend on the rate if rate_dependent is False, got ")
    for one in (damped, dashpot):
        with pytest.raises(ValueError, match=sentence):
            md.simulate(STACK, one, t_end=0.01)
