"""Scenes that provably never end are refused without a stop condition; other scenes run."""

import math
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import granular as gr

ELASTIC = gr.ConstantRestitution(1.0)
SPRING = gr.LinearDashpot(1e7)
SENTENCE = (r"^`t_end` must be given, got None\. A run of elastic balls .* does not end by itself\. Give t_end=, "
            r"until= or max_events=\.$")
BALL = gr.Scene([math.inf, 1.0], [0.0, 0.5], [9.5], [0.0, 0.0], 9.81)
BOX = gr.Scene([math.inf, 1.0, 2.0, math.inf], [0.0, 0.1, 0.1, 0.0], [0.1, 0.2, 0.3], [0.5, 1.5, 0.5, 0.5])
LIMITED = {"max_events": 200}


def refused(run, *given, **options):
    """Return whether a run is refused because it never ends."""
    try:
        run(*given, **options)
    except ValueError as error:
        if "does not end by itself" not in str(error):
            raise
        return True
    return False


def at_random(rng, floor, ceiling, gravity=0.0, force=False):
    """Return a scene of one to four balls."""
    n = int(rng.integers(2 - min(1, floor + ceiling), 5))
    mass = [*[math.inf] * floor, *rng.uniform(0.2, 2.0, n), *[math.inf] * ceiling]
    radius = np.where(np.isinf(mass), 0.0, 0.1)
    velocity = np.where(np.isinf(mass), 0.0, rng.normal(size=len(mass)))
    push = np.where(np.isinf(mass), 0.0, rng.uniform(0.5, 1.0, len(mass))) if force else None
    return gr.Scene(mass, radius, rng.uniform(0.01, 0.5, len(mass) - 1), velocity, gravity, external_force=push)


FALLING = {
    "a floor under gravity": lambda rng: at_random(rng, True, False, 9.81),
    "a ceiling under forces": lambda rng: at_random(rng, False, True, force=True),
    "a box under gravity": lambda rng: at_random(rng, True, True, 9.81),
    "a floor at constant velocity": lambda rng: (
        scene := at_random(rng, True, False, 9.81)).replace(velocity=scene.velocity + rng.normal()),
    "walls that part": lambda rng: (
        scene := at_random(rng, True, True, 9.81)).replace(velocity=[*scene.velocity[:-1], 0.3]),
}
ENCLOSED = {
    "a box": lambda rng: at_random(rng, True, True),
    "a box at constant velocity": lambda rng: (
        scene := at_random(rng, True, True)).replace(velocity=scene.velocity + rng.normal()),
}
CLASSES = FALLING | ENCLOSED


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("make", CLASSES.values(), ids=CLASSES)
def test_scenes_that_never_end_are_refused_by_everyone(make, seed):
    rng = np.random.default_rng([11, seed])
    scene = make(rng)
    law = gr.Hertz(1e8) if seed % 2 else SPRING
    table = gr.TabulatedRestitution([0.1, 1.0], [1.0, 1.0])
    case = gr.Case(scene, law)
    for run in (partial(gr.compare, scene, law), partial(gr.edmd.simulate, scene, ELASTIC),
                partial(gr.edmd.simulate, scene, table), partial(gr.edmd.simulate, scene, gr.restitution_of(law)),
                partial(gr.md.simulate, scene, law), partial(gr.md.simulate, scene, law, method="verlet"),
                partial(case.simulate, "edmd"), partial(case.simulate, "md")):
        with pytest.raises(ValueError, match=SENTENCE):
            run()
    hard = gr.edmd.simulate(scene, ELASTIC, **LIMITED)
    assert hard.status is gr.Status.max_events
    assert gr.md.simulate(scene, law, max_events=20).status is gr.Status.max_events
    assert gr.edmd.simulate(scene, ELASTIC, t_end=0.1).status is gr.Status.time
    assert len(list(zip(range(3), gr.edmd.events(scene, ELASTIC), gr.md.events(scene, law), strict=False))) == 3


@pytest.mark.parametrize("seed", range(4))
def test_free_balls_that_forces_press_together_are_refused(seed):
    """Before, such a pair bounced until a million contacts."""
    rng = np.random.default_rng([14, seed])
    scene = at_random(rng, False, False, 9.81 * (seed % 2))
    acceleration = np.cumsum(-rng.uniform(0.5, 1.0, scene.n)) + rng.normal()
    scene = scene.replace(external_force=scene.mass * acceleration)
    for run in (partial(gr.edmd.simulate, scene, ELASTIC), partial(gr.md.simulate, scene, SPRING),
                partial(gr.compare, scene, SPRING)):
        with pytest.raises(ValueError, match="elastic balls that forces press together does not end by itself"):
            run()
    assert gr.edmd.simulate(scene, ELASTIC, **LIMITED).status is gr.Status.max_events
    apart = scene.replace(external_force=scene.mass * acceleration[::-1])
    assert not refused(gr.edmd.simulate, apart, ELASTIC)
    common = scene.replace(external_force=0.3 * scene.mass)
    assert not refused(gr.edmd.simulate, common, ELASTIC)


@pytest.mark.parametrize("law", [SPRING, gr.Hertz(1e8)])
def test_soft_elastic_balls_that_touch_at_rest_under_a_load_are_refused(law):
    """They sink, and vibrate forever without a contact that ends. Before, the run took 20 million steps."""
    lying = BALL.replace(gap=[0.0])
    pile = gr.Scene([math.inf, 1.0, 2.0], [0.0, 0.1, 0.1], [0.0, 0.0], [0.0] * 3, 9.81)
    pressed = gr.Scene([1.0, 2.0], [0.1, 0.1], [0.0], [0.0, 0.0], external_force=[1.0, -1.0])
    for scene in (lying, pile, pressed):
        assert refused(gr.md.simulate, scene, law)
        assert refused(gr.compare, scene, law)
        assert gr.edmd.simulate(scene, ELASTIC).status is gr.Status.quiet


@pytest.mark.parametrize(("law", "depth"), [(gr.Hertz(1e8), (2.5 * 9.81 / 1e8) ** (2.0 / 3.0)),
                                            (SPRING, 2.0 * 9.81 / 1e7)])
def test_the_default_step_resolves_the_contact_of_a_ball_that_touches_at_rest(law, depth):
    """Before, it was 16 s for a Hertz law, and the remedy was a longer one."""
    run = gr.md.simulate(BALL.replace(gap=[0.0]), law, method="verlet", t_end=0.01, samples=2000)
    assert run.status is gr.Status.time
    assert -run.gap.min() == pytest.approx(depth, rel=1e-4)


def near_misses(rng):
    """Yield scenes, rules and options that are one step beside a class."""
    falling, boxed = at_random(rng, True, False, 9.81), at_random(rng, True, True)
    odd = [1.0] * (falling.n_pairs - 1) + [0.999]
    yield falling, gr.ConstantRestitution(odd), {"max_events": None}
    yield falling.replace(gravity=0.0), ELASTIC, {}
    yield falling, lambda v, pair: 1.0, LIMITED
    yield falling, gr.ThorntonRestitution(1e9), LIMITED
    yield falling.replace(gap=[0.0, *falling.gap[1:]], velocity=np.zeros(falling.n)), ELASTIC, LIMITED
    yield boxed.replace(velocity=np.full(boxed.n, 0.5)), ELASTIC, {}
    yield boxed.replace(velocity=[0.5, *boxed.velocity[1:]]), ELASTIC, LIMITED
    for remedy in ({"tc": 1e-3}, {"elastic_below": 0.1}, {"collapse": "merge", "merge_below": 1e-3}):
        yield boxed, ELASTIC, remedy | LIMITED


@pytest.mark.rotating
@pytest.mark.parametrize("seed", range(4))
def test_scenes_beside_the_classes_are_not_refused(seed):
    for scene, rule, options in near_misses(np.random.default_rng([12, seed])):
        if options.get("max_events", 0) is None:
            assert not refused(gr.edmd.simulate, scene, rule, t_end=None)
        else:
            gr.edmd.simulate(scene, rule, **options)
        if "max_events" in options:  # the default limit would take minutes, so only the check runs
            options = {key: value for key, value in options.items() if key != "max_events"}
            assert not refused(checks_only, scene, rule, **options)


def checks_only(scene, rule, **options):
    """Check the arguments of a hard run, and stop at its first collision."""
    class Enough(Exception):
        pass

    def stop(row):
        raise Enough

    with suppress(Enough):
        gr.edmd.simulate(scene, rule, on_event=stop, **options)


@pytest.mark.rotating
@pytest.mark.parametrize("count", [50, pytest.param(150, marks=pytest.mark.soak)])
def test_what_ends_is_not_refused(count):
    """A random elastic scene that ends with a status of its own is in no class."""
    rng = np.random.default_rng(13)
    ended = 0
    for _ in range(count):
        walls = rng.random(2) < 0.5
        scene = at_random(rng, *walls.tolist(), float(rng.choice([0.0, 9.81])), bool(rng.random() < 0.3))
        scene = scene.replace(velocity=scene.velocity + (rng.random(scene.n) < 0.3) * rng.normal(size=scene.n))
        run = gr.edmd.simulate(scene, ELASTIC, max_events=2000)
        if run.status is not gr.Status.max_events:
            ended += 1
            assert not refused(gr.edmd.simulate, scene, ELASTIC)
    assert ended > count // 4


def test_rings_and_pendula_that_never_end_are_refused():
    ring = gr.Scene([1.0, 2.0, 1.0], [0.1] * 3, [0.1] * 3, [1.0, 0.0, 0.0], ring=True)
    hung = gr.scenes.pendulum_cradle(3)
    for scene, why in ((ring, "on a ring"), (hung, "of pendula")):
        for run in (partial(gr.compare, scene, SPRING), partial(gr.edmd.simulate, scene, ELASTIC),
                    partial(gr.md.simulate, scene, SPRING)):
            with pytest.raises(ValueError, match=rf"`t_end` must be given, got None\. A run {why} does not end by "
                                                 r"itself\. Give t_end="):
                run()


def test_soft_spheres_with_a_limit_or_losses_run():
    assert gr.md.simulate(BALL, SPRING, max_steps=50).status is gr.Status.max_events
    assert gr.md.simulate(BALL, SPRING, disturbed="stop", max_events=5).status is gr.Status.max_events
    assert not refused(gr.md.simulate, BALL, gr.LinearDashpot(1e7, 2e3))
    pressed = BOX.replace(gap=[-1e-4, -1e-4, -1e-4], velocity=[0.0, 1e-3, 0.0, 0.0])
    assert not refused(gr.md.simulate, pressed, SPRING, max_events=20)
    assert gr.md.simulate(pressed, SPRING, max_events=20).status in gr.Status


def test_an_own_law_that_declares_no_rate_is_elastic_and_one_that_says_nothing_is_not():
    class Silent:
        def force(self, xi, xi_dot, pair):
            return 1e7 * xi * (1.0 + xi)

    class Declared(Silent):
        rate_dependent = False

    assert refused(gr.md.simulate, BALL, Declared())
    assert not refused(gr.md.simulate, BALL, Silent(), max_steps=20)
    assert refused(gr.compare, BALL, Declared())


def test_walls_that_close_end_a_run():
    closing = gr.Scene([math.inf, 1.0, math.inf], [0.0, 0.1, 0.0], [0.1, 0.1], [0.0, 1.0, -0.05], 9.81)
    assert gr.edmd.simulate(closing, ELASTIC, t_end=1.0).status is gr.Status.time
    assert not refused(checks_only, closing, ELASTIC)


def test_the_command_refuses_at_once_and_names_both_options(granular):
    Path("ball.toml").write_text(gr.cases.dumps(gr.Case(BALL, SPRING)), encoding="utf-8")
    code, out, err = granular("compare ball.toml")
    assert (code, out) == (2, "")
    assert "Give t_end=, until= or max_events=." in err
    assert err.count("\n") == 1
    assert granular("compare ball.toml --max-events 5")[0] == 3


def test_every_ready_made_case_passes_the_check():
    """Each ends by itself or holds its own end."""
    for name in gr.cases.names():
        case = gr.cases.make(name)
        if case.law is not None:
            assert not refused(gr.md.simulate, case.scene, case.law, until=case.until, t_end=case.t_end, max_steps=1)
        if case.t_end is None and case.until is None:
            assert not refused(checks_only, case.scene, case.physics("edmd"))


def test_a_limit_names_the_option_that_raises_it():
    advice = "give t_end= or until="
    hard = gr.edmd.simulate(BALL, ELASTIC, max_events=3)
    assert hard.message.endswith(f" after 3 collisions; raise max_events=, or {advice}")
    assert gr.edmd.simulate(BALL, ELASTIC, max_events=3, t_end=1e3).message.endswith("; raise max_events=")
    for method in ("located", "verlet"):
        for option, limit in (("max_events", 3), ("max_steps", 5)):
            run = gr.md.simulate(BALL, SPRING, method=method, **{option: limit})
            assert run.status is gr.Status.max_events
            assert f"; raise {option}=, or {advice}" in run.message
