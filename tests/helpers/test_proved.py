"""The judge's judge: linear laws in ball arithmetic, against stored references, a border between two counts, and the
engine's own word about its error. Needs python-flint; soak."""

import importlib.util
import json
import math
from pathlib import Path

import numpy as np
import pytest

import granular as gr
from tests.helpers import scenes_at_random as draw
from tests.helpers.condition import response

pytestmark = [pytest.mark.soak, pytest.mark.skipif(not importlib.util.find_spec("flint"), reason="needs python-flint")]
SETS = json.loads(
    (Path(__file__).parents[1] / "reference" / "reference_soft.json").read_text(encoding="utf-8")
)["linear"]
NEAR = 1e-16
"""Radius of a ball, in m/s, above which more digits are asked for."""


def ball(x):
    """A number as it is written, enclosed."""
    from flint import arb

    return arb(repr(x))


def three_balls(one, restitution=None):
    """The scene of a set at the first touch of the floor: masses from radii, speed from the height, γ from ε."""
    from flint import arb

    from tests.helpers.proved import Motion, damping

    radii, eps = [ball(one["R1"]), ball(one["R2"])], ball(one["eps"]) if restitution is None else restitution
    m1, m2 = (arb.pi() * 4 / 3 * r**3 * ball(one["rho"]) for r in radii)
    g, k = ball(one["g"]), ball(one["k"])
    speed = (2 * g * (ball(one["height"]) - radii[0])).sqrt() if one["g"] else ball(-one["v10"])
    gamma = [2 * damping(eps) * (k * m).sqrt() for m in (m1, m1 * m2 / (m1 + m2))]
    return Motion([arb(0), 1 / m1, 1 / m2], [k, k], gamma, [arb(0), -ball(one["gap"])], [speed, arb(0)], g)


def until_second(motion, share, near=NEAR):
    """Contacts of the balls that begin before the floor is met a second time, followed to their ends."""
    from flint import arb

    from tests.helpers.proved import Undecided

    while sum(row[0] == 0 for row in motion.log) < 2 and not motion.step(arb(10), share):
        pass
    while any(row[0] == 1 and row[2] is None for row in motion.log):
        motion.step(arb(10), share)
    upper = [row for row in motion.log if row[0] == 1]
    if upper and max(one.rad() for one in upper[-1][4]) > near:
        raise Undecided("not near enough")
    return upper


@pytest.mark.parametrize("one", SETS, ids=lambda one: str(one["id"]))
def test_the_linear_references_are_proved(one):
    """Counts, and to 12 digits of what they hang on times and velocities; the stored numbers are doubles."""
    from tests.helpers.proved import proved

    upper = proved(lambda: three_balls(one), until_second)
    assert len(upper) == one["n"]
    times = np.array([[float(row[1].mid()), float(row[2].mid())] for row in upper])
    np.testing.assert_allclose(times, one["contacts12"], rtol=1e-12, atol=1e-18)
    assert max(float(row[2].rad()) for row in upper) < 1e-14 * abs(times).max()
    assert [float(v.mid()) for v in upper[-1][4][1:]] == pytest.approx([one["v1"], one["v2"]], rel=0, abs=3e-15)


def test_the_border_between_four_and_three_contacts():
    """ε to 12 digits and more, both ends proved; the sum of 18 known digits lies between."""
    from flint import arb

    from tests.helpers.proved import proved

    def contacts(restitution):
        return len(proved(lambda: three_balls(SETS[0], arb(restitution)), lambda m, s: until_second(m, s, math.inf)))

    low, high = 7_900_000_000_000_000, 8_100_000_000_000_000  # in units of 1e-16
    assert (contacts(f"{low}e-16"), contacts(f"{high}e-16")) == (4, 3)
    while high - low > 1:
        middle = (low + high) // 2
        count = contacts(f"{middle}e-16")
        assert count in (3, 4)
        low, high = (middle, high) if count == 4 else (low, middle)
    assert (low, high) == (7_981_583_625_225_836, 7_981_583_625_225_837)


@pytest.mark.parametrize("seed", range(100))
def test_the_engine_is_as_near_as_it_says(seed):
    """Random rows of dashpots: final velocities are right to what docs/guide/limits.md promises of `error_estimate`."""
    from flint import arb

    from tests.helpers.proved import Motion, Undecided, proved

    rng = np.random.default_rng(seed)
    scene = draw.scene(rng, (2, 4), gaps=("wide",), walls=(0.6, 0.0, 0.0))
    law = [gr.LinearDashpot(10.0 ** rng.uniform(2.0, 6.0), 10.0 ** rng.uniform(-2.0, 1.0) * (rng.random() < 0.8))
           for _ in scene.pairs]
    met = gr.md.simulate(scene, law, max_events=int(rng.integers(1, 9)), max_steps=20_000)
    t_end = float(rng.uniform(0.9, 1.1) * met.time[-1]) or 0.1
    run = gr.md.simulate(scene, law, t_end=t_end, max_steps=20_000)
    assert run.status is gr.Status.time

    def make():
        rates = [arb(a) - arb(b) for a, b in zip(scene.velocity[:-1], scene.velocity[1:], strict=True)]
        inverse = [arb(0) if math.isinf(m) else 1 / arb(m) for m in scene.mass]
        return Motion(inverse, [arb(one.k) for one in law], [arb(one.gamma) for one in law],
                      [-arb(gap) for gap in scene.gap], rates, arb(scene.gravity))

    def ask(motion, share):
        while not motion.step(arb(t_end), share):
            pass
        if max(one.rad() for one in motion.eta) > NEAR * 1e-3:
            raise Undecided("not near enough")
        return motion

    motion = proved(make, ask)
    rates = np.array([float(eta.mid()) for eta in motion.eta])
    off = np.abs(-np.diff(run.velocity[-1]) - rates).max()
    speed = max(float(np.abs(run.contacts["v_in"][:, 0] - run.contacts["v_in"][:, 1]).max(initial=0.0)),
                float(np.ptp(scene.velocity))) or 1.0

    def last(one):
        return gr.md.simulate(one, law, t_end=t_end, max_steps=20_000).velocity[-1]

    condition = max(1.0, float(response(last, scene).max()) / speed)
    promised = (run.stats["error_estimate"] + 2e-14 + 3e-17 * run.stats["steps"]) * condition
    assert off <= 2.0 * promised * speed  # of two bodies
    assert len([row for row in motion.log if row[2] is not None]) == np.isfinite(run.contacts["t_end"]).sum()
