"""What the equations allow, every engine must show: boosts, mirror images, other units, reversal; at random.

A scene is used where the answer is well defined: a shift of gaps and speeds by 1e-10 changes it by less than 1e-7.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings, strategies as st

import granular as gr
from tests.helpers.scenes_at_random import ALL, ELASTIC, LAWS, scenes, soft_scenes

FREE = (0.0, 0.0, 0.0)
MOVING = (0.4, 0.2, 0.5)
SMALL: dict[str, Any] = {"balls": (2, 4), "size": 1e-3}
METHODS = ("verlet", "symplectic-euler", "rk4", "gear5")
pytestmark = pytest.mark.filterwarnings("ignore:dt = ")
SOFT = pytest.mark.parametrize("method", ["located", *METHODS])
NO_MEMORY = tuple(name for name in LAWS if name not in ("Walton-Braun", "own with memory"))
STEADY = tuple(name for name in LAWS if name != "stiffening")
"""Laws whose force stays a number when steps are too long."""
KEPT = ("time", "velocity", "gap", "force")


def quick(examples: int) -> Any:
    """Settings for that many scenes."""
    return settings(max_examples=examples, deadline=None, suppress_health_check=[HealthCheck.filter_too_much])


def hard(scene: gr.Scene, eps: float = 0.8, **options: Any) -> gr.Trajectory:
    """Hard spheres, for 1 s."""
    return gr.edmd.simulate(scene, gr.ConstantRestitution(eps), **{"t_end": 1.0, "max_events": 40} | options)


def soft(scene: gr.Scene, laws: Any, method: str, **options: Any) -> gr.Trajectory:
    """Soft spheres, for 0.25 s, in steps of 2^-11 s where they are fixed."""
    step = {"max_steps": 800} if method == "located" else {"dt": 2.0**-11}
    return gr.md.simulate(scene, laws, method=method, **{"t_end": 0.25, "max_events": 20, "engine": "plain"} | step
                          | options)


def shifted(scene: gr.Scene) -> gr.Scene:
    """Gaps and velocities a little larger."""
    by = 1.0 + 1e-10 * np.cos(1.0 + np.arange(scene.n))
    return scene.replace(gap=scene.gap * by[1:], velocity=scene.velocity * by)


def size(run: gr.Trajectory) -> float:
    """The largest speed."""
    return max(float(abs(run.velocity).max()), 1e-3)


def step_of(method: str) -> float:
    """How well the times of a contact are known."""
    return 1e-9 if method == "located" else 2.0**-10


def usable(run: gr.Trajectory, beside: gr.Trajectory) -> None:
    """Take this scene only if it reached its end, and rounding decides nothing."""
    assume(run.status is beside.status is gr.Status.time)
    assume(run.contacts["pair"].tolist() == beside.contacts["pair"].tolist())
    assume(abs(run.velocity[-1] - beside.velocity[-1]).max() < 1e-7 * size(run))


def same(run: gr.Trajectory, velocity: Any, other: gr.Trajectory, pairs: Any, step: float = 1e-9) -> None:
    """The same number of contacts of every pair, at the same times to within a `step`, and the same end."""
    scale = size(run) + size(other)
    assert np.allclose(velocity, run.velocity[-1], rtol=0, atol=1e-9 * scale)
    for pair in range(run.scene.n_pairs):
        one, two = run.of(pair), other.of(int(pairs[pair]))
        assert len(one) == len(two)
        assert np.allclose(one["t_begin"], two["t_begin"], rtol=0, atol=step)
        faint = 1e-9 * scale * run.scene.mass[~run.scene.is_wall].max()
        assert np.allclose(one["impulse"], two["impulse"], rtol=1e-3 if step > 1e-9 else 1e-7, atol=faint)


# a boost


def boosted(scene: gr.Scene, speed: float) -> gr.Scene:
    """The scene from a train that goes the other way."""
    return scene.replace(velocity=scene.velocity + speed)


@quick(30)
@given(scenes(walls=MOVING, **SMALL))
def test_hard_spheres_from_a_moving_train(scene: gr.Scene) -> None:
    run = hard(scene)
    usable(run, hard(shifted(scene)))
    train = hard(boosted(scene, -1.5))
    same(run, train.velocity[-1] + 1.5, train, range(scene.n_pairs))
    assert np.allclose(train.position[-1] - run.position[-1], -1.5, atol=1e-9)


@pytest.mark.rotating
@SOFT
@quick(7)
@given(soft_scenes(STEADY, walls=MOVING, gaps=ALL, **SMALL))
def test_soft_spheres_from_a_moving_train(method: str, drawn: Any) -> None:
    """Walls that move at constant speed, and weight, look the same from there."""
    scene, laws = drawn
    run = soft(scene, laws, method)
    usable(run, soft(shifted(scene), laws, method))
    train = soft(boosted(scene, -1.5), laws, method)
    same(run, train.velocity[-1] + 1.5, train, range(scene.n_pairs), step_of(method))
    closing = [one.contacts["v_in"] @ [1.0, -1.0] for one in (run, train)]
    if method == "located":
        assert np.allclose(*closing, rtol=0, atol=1e-9 * size(run))
    if not scene.is_wall.any():
        mass = scene.mass.sum()
        assert train.momentum()[-1] == pytest.approx(run.momentum()[-1] - 1.5 * mass, abs=1e-12 * mass)
        seen = run.energy() - 1.5 * run.momentum() + 0.5 * 1.5**2 * mass
        assert np.allclose(train.energy(), seen, rtol=0, atol=1e-9 * mass * size(run) ** 2, equal_nan=True)


# the mirror


def mirrored(scene: gr.Scene) -> gr.Scene:
    """The scene from behind."""
    return gr.Scene(scene.mass[::-1], scene.radius[::-1], scene.gap[::-1], -scene.velocity[::-1])


@quick(30)
@given(scenes(walls=MOVING, gravity=(0.0,), **SMALL))
def test_hard_spheres_in_a_mirror(scene: gr.Scene) -> None:
    run = hard(scene, ties="left")
    usable(run, hard(shifted(scene), ties="left"))
    image = hard(mirrored(scene), ties="right")
    same(run, -image.velocity[-1][::-1], image, range(scene.n_pairs)[::-1])


@pytest.mark.rotating
@SOFT
@quick(7)
@given(soft_scenes(STEADY, walls=MOVING, gravity=(0.0,), gaps=ALL, **SMALL))
def test_soft_spheres_in_a_mirror(method: str, drawn: Any) -> None:
    scene, laws = drawn
    run = soft(scene, laws, method)
    usable(run, soft(shifted(scene), laws, method))
    image = soft(mirrored(scene), laws[::-1], method)
    same(run, -image.velocity[-1][::-1], image, range(scene.n_pairs)[::-1], step_of(method))
    assert np.allclose(image.force[-1][::-1], run.force[-1], rtol=1e-6, atol=1e-6 * run.force.max() + 1e-12)


# other units

LENGTH, TIME, MASS = 2.0**8, 2.0**-4, 2.0**4


def rescaled(law: Any) -> Any:
    """The same law in other units of length, time and mass, by the dimensions of its numbers."""
    root = math.sqrt(LENGTH)
    if isinstance(law, gr.LinearDashpot):
        return gr.LinearDashpot(law.k * MASS / TIME**2, law.gamma * MASS / TIME)
    if isinstance(law, gr.ViscoelasticHertz):
        return gr.ViscoelasticHertz(law.k * MASS / TIME**2 / root, law.gamma * MASS / TIME / root)
    if isinstance(law, gr.WaltonBraun):
        return gr.WaltonBraun(law.k_load * MASS / TIME**2, law.k_unload * MASS / TIME**2)
    return type(law)(law.k * MASS / TIME**2 / root, *([law.alpha] if isinstance(law, gr.TsujiHertz) else []))


def units(scene: gr.Scene) -> gr.Scene:
    """The scene in other units."""
    return gr.Scene(scene.mass * MASS, scene.radius * LENGTH, scene.gap * LENGTH, scene.velocity * LENGTH / TIME,
                    scene.gravity * LENGTH / TIME**2, scene.origin * LENGTH)


LINEAR = ("spring", "dashpot", "Walton-Braun")


def in_other_units(scene: gr.Scene, laws: Any, method: str) -> gr.Trajectory:
    """The run of the scene in other units."""
    step = {} if method == "located" else {"dt": 2.0**-11 * TIME}
    return soft(units(scene), tuple(map(rescaled, laws)), method, samples=5, t_end=0.25 * TIME, **step)


@pytest.mark.rotating
@SOFT
@quick(7)
@given(st.data())
def test_soft_spheres_in_other_units(method: str, data: Any) -> None:
    """Powers of two change no bit of any number that is kept, but those of powers that are not whole."""
    names = LINEAR[:2] if method == "located" else (*LINEAR, "Hertz", "viscoelastic", "Tsuji")
    scene, laws = data.draw(soft_scenes(names, walls=MOVING, gaps=ALL, **SMALL))
    run, other = soft(scene, laws, method, samples=5), in_other_units(scene, laws, method)
    scale = {"time": TIME, "velocity": LENGTH / TIME, "gap": LENGTH, "force": MASS * LENGTH / TIME**2}
    for name in KEPT:
        assert (getattr(run, name) * scale[name]).tobytes() == getattr(other, name).tobytes(), name
    for name, unit in (("t_begin", TIME), ("t_end", TIME), ("xi_max", LENGTH), ("impulse", MASS * LENGTH / TIME)):
        assert (run.contacts[name] * unit).tobytes() == other.contacts[name].tobytes(), name


@quick(7)
@given(soft_scenes(("Hertz", "viscoelastic", "Tsuji", "Walton-Braun"), walls=MOVING, gaps=ALL, **SMALL))
def test_located_soft_spheres_of_all_powers_in_other_units(drawn: Any) -> None:
    scene, laws = drawn
    run, other = soft(scene, laws, "located", samples=5), in_other_units(scene, laws, "located")
    usable(run, soft(shifted(scene), laws, "located"))
    assert np.allclose(other.velocity * (TIME / LENGTH), run.velocity, rtol=0, atol=1e-10 * size(run))
    assert other.contacts["pair"].tolist() == run.contacts["pair"].tolist()
    assert np.allclose(other.contacts["t_begin"] / TIME, run.contacts["t_begin"], rtol=0, atol=1e-10)


# reversal


@quick(30)
@given(scenes(walls=MOVING, gaps=("wide",), balls=(2, 4), size=1e-2))
def test_elastic_hard_spheres_run_back(scene: gr.Scene) -> None:
    there = hard(scene, 1.0)
    usable(there, hard(shifted(scene), 1.0))
    assume(len(there.contacts) > 1)
    back = hard(scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1]), 1.0)
    assert np.allclose(-back.velocity[-1], scene.velocity, rtol=0, atol=1e-9 * size(there))
    assert np.allclose(back.gap[-1], scene.gap, rtol=0, atol=1e-9 * (size(there) + scene.gap.max()))
    assert back.contacts["pair"].tolist() == there.contacts["pair"].tolist()[::-1]


@pytest.mark.rotating
@quick(8)
@given(soft_scenes(ELASTIC, walls=MOVING, gaps=("wide", "equal", "overlapping"), **SMALL))
def test_elastic_soft_spheres_run_back(drawn: Any) -> None:
    """Also when they are turned round in the middle of a contact; none begins at rest, which √rounding would move."""
    scene, laws = drawn
    there = soft(scene, laws, "located")
    usable(there, soft(shifted(scene), laws, "located"))
    turned = scene.replace(gap=there.gap[-1], velocity=-there.velocity[-1])
    back = soft(turned, laws, "located")
    assert np.allclose(-back.velocity[-1], scene.velocity, rtol=0, atol=1e-9 * size(there))
    assert np.allclose(back.gap[-1], scene.gap, rtol=0, atol=1e-9 * (size(there) + abs(scene.gap).max()))


@pytest.mark.rotating
@quick(7)
@given(soft_scenes(NO_MEMORY, gaps=ALL, **SMALL))
def test_soft_spheres_in_two_parts(drawn: Any) -> None:
    """Stopped anywhere, and gone on with from gaps and velocities."""
    scene, laws = drawn
    run = soft(scene, laws, "located")
    usable(run, soft(shifted(scene), laws, "located"))
    half = soft(scene, laws, "located", t_end=0.1)
    rest = soft(scene.replace(gap=half.gap[-1], velocity=half.velocity[-1]), laws, "located", t_end=0.15)
    assert np.allclose(rest.velocity[-1], run.velocity[-1], rtol=0, atol=1e-9 * size(run))
