"""Any other law on the located engine: a user's own, with memory, without traits; and laws mixed in one scene."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

from granular import until
from granular.laws import Hertz, LinearDashpot, ViscoelasticHertz, WaltonBraun
from granular.md import simulate as run
from granular.run.trajectory import Status
from granular.scene import Pair, Scene
from tests.helpers.scenes_at_random import OwnDashpot, OwnHertz
from tests.helpers.solved_by_scipy import counted


@dataclass(frozen=True)
class MyViscoelastic:
    """A viscoelastic law that does not say it is a power law."""

    k: float
    gamma: float
    exponent = 1.5

    def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
        return math.sqrt(xi) * (self.k * xi + self.gamma * xi_dot)


def three_balls(gap: float = 1e-4) -> Scene:
    return Scene([math.inf, 3.77, 0.00377], [0.0, 0.1, 0.01], [0.0, gap], [0.0, -3.0, -3.0], 9.81)


@pytest.mark.rotating
@pytest.mark.parametrize(
    ("known", "mine"),
    [
        (LinearDashpot(5e7, 1500.0), OwnDashpot(5e7, 1500.0)),
        (ViscoelasticHertz(1e7, 2e3), MyViscoelastic(1e7, 2e3)),
        (Hertz(1e7), OwnHertz(1e7)),
    ],
)
def test_a_law_without_traits_gives_the_same_motion(known: Any, mine: Any) -> None:
    """Collocation against power series: every column of the log, to 1e-12."""
    one = run(three_balls(), (known,) * 2, until=until.contact(0, 2), engine="plain")
    other = run(three_balls(), (mine,) * 2, until=until.contact(0, 2), engine="plain")
    assert one.contacts["pair"].tolist() == other.contacts["pair"].tolist()
    for name in ("t_begin", "t_end", "duration", "v_in", "v_out", "xi_max", "force_max", "impulse"):
        scale = abs(one.contacts[name]).max()
        assert other.contacts[name] == pytest.approx(one.contacts[name], abs=1e-11 * scale, rel=0), name


@pytest.mark.parametrize("eps", [0.03, 0.01, 1e-3])
def test_a_very_stiff_unloading_is_no_more_work(eps: float) -> None:
    """Its force carries the rounding of the overlap times k_unload, which smaller steps cannot mend."""
    scene = Scene([1.0, 1.0], [0.1, 0.1], [0.0], [1.0, 0.0])
    soft = run(scene, (WaltonBraun(1.0, 1.0 / eps**2),), until=until.separated(), engine="plain")
    v = soft.velocity[-1]
    assert v[1] - v[0] == pytest.approx(eps, abs=1e-15 / eps)
    assert soft.stats["steps"] < 200


def test_exceptions_of_the_law_pass_through() -> None:
    """The user's own error, unwrapped."""

    @dataclass(frozen=True)
    class Broken:
        def force(self, xi: float, xi_dot: float, pair: Pair) -> float:
            if xi > 1e-4:
                raise KeyError("mine")
            return 1e6 * xi

    with pytest.raises(KeyError, match="mine"):
        run(three_balls(), (Broken(),) * 2, engine="plain")


@pytest.mark.parametrize(
    ("law", "rests"),
    [(LinearDashpot(1e6, 100.0), True), (ViscoelasticHertz(1e7, 1e5), True), (LinearDashpot(1e6), False)],
)
def test_a_ball_comes_to_rest_on_the_floor(law: Any, rests: bool) -> None:
    """`resting` once no contact can open; without damping the ball is bound forever, `quiet`, or bounces."""
    lying = 9.81 / 1e6
    scene = Scene([math.inf, 1.0], [0.0, 0.1], [-0.99 * lying if not rests else 1e-3], [0.0, 0.0], 9.81)
    soft = run(scene, (law,), engine="plain", max_steps=20_000)
    assert soft.status is (Status.resting if rests else Status.quiet)
    assert "equilibrium" in soft.message


@pytest.mark.rotating
@pytest.mark.parametrize("zeta", [5.0, 50.0, 1e3, 1e5])
@pytest.mark.parametrize("engine", ["plain", "compiled"])
@pytest.mark.usefixtures("compiled_rest_tests")
def test_a_strongly_damped_pile_creeps_to_rest(zeta: float, engine: str) -> None:
    """Proved from bounds of its overdamped motion after 1 000 to 2 600 steps; following it would take millions."""
    if engine == "compiled":
        pytest.importorskip("numba")
    scene = three_balls(gap=0.0)
    laws = tuple(LinearDashpot(5e7, 2.0 * zeta * math.sqrt(5e7 * pair.m_eff)) for pair in scene.pairs)
    soft = run(scene, laws, until=until.contact(0, 2), engine=engine, max_steps=5000)
    assert soft.status is Status.resting
    assert "equilibrium" in soft.message


def test_a_start_inside_an_overlap() -> None:
    """Overlap at the start: the contact begins at once; one that recedes faster than its force waits as residual."""
    law = (LinearDashpot(1e4, 50.0),)
    pressed = run(Scene([1.0, 1.0], [0.1] * 2, [-1e-3], [0.0, 0.0]), law, engine="plain")
    assert pressed.contacts["t_begin"][0] == 0.0
    parting = run(Scene([1.0, 1.0], [0.1] * 2, [-1e-3], [0.0, 5.0]), law, engine="plain")
    assert len(parting.contacts) == 0
    assert np.diff(parting.velocity[-1])[0] == 5.0


@dataclass(frozen=True)
class Yielding:
    """F = k ξ / (1 + ξ/x), never more than k x: it cannot bear every weight."""

    k: float
    x: float

    def force(self, xi: float, xi_dot: float, pair: Any) -> float:
        return self.k * xi / (1.0 + xi / self.x)


def test_a_law_that_cannot_bear_the_weight_lets_it_sink() -> None:
    """Beside DOP853; from a height, and from within."""
    from scipy.integrate import solve_ivp

    rng = np.random.default_rng(4)
    for _ in range(8):
        mass, x = 10.0 ** rng.uniform(-1, 1), 10.0 ** rng.uniform(-3, -1)
        law = Yielding(mass * 9.81 / x * rng.uniform(0.05, 0.95), x)
        deep, speed, end = rng.uniform(0.01, 0.2), rng.uniform(-2, 2), rng.uniform(0.02, 0.1)
        scene = Scene([math.inf, mass], [0.0, 1.0], [-deep], [0.0, -speed], 9.81)
        soft = run(scene, (law,), t_end=end)
        if len(soft.contacts) > 1 or not np.isnan(soft.contacts["t_end"]).all():
            continue  # it parted

        def motion(t: float, y: Any, law: Yielding = law, mass: float = mass) -> Any:
            return [y[1], 9.81 - law.force(y[0], 0.0, None) / mass]

        xi, eta = solve_ivp(counted(motion), (0.0, end), [deep, speed], "DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
        assert soft.gap[-1, 0] == pytest.approx(-xi, rel=1e-10)
        assert soft.velocity[-1, 1] == pytest.approx(-eta, rel=1e-9, abs=1e-10)
        assert soft.stats["error_estimate"] < 1e-13
