"""A light ball on a heavy one: the scene of the paper, and checks of the limit by other means."""

import math

import mpmath
import numpy as np
import pytest
from scipy.linalg import expm

import granular as gr
from granular import adiabatic
from granular.run.trajectory import Status

SECOND_FLOOR = gr.until.contact(0, 2)


def drop(ratio=10.0, gap=1e-4, height=0.6, upper=0.01):
    """Return the paper's scene with R1/R2 = `ratio`."""
    return gr.scenes.three_balls((ratio * upper, upper), gap, height)


def dashpots(scene, restitution, k=(5e7, 5e7)):
    eps = restitution if isinstance(restitution, tuple) else (restitution, restitution)
    return [gr.LinearDashpot.from_restitution(e, ki, p) for e, ki, p in zip(eps, k, scene.pairs, strict=True)]


def lighter(scene, law, factor):
    """Same motion of the upper ball, `factor` less push on the lower one: m2, k12 and γ12 all multiplied by it."""
    mass = scene.mass * np.array([1.0, 1.0, factor])
    return scene.replace(mass=mass), [law[0], gr.LinearDashpot(law[1].k * factor, law[1].gamma * factor)]


def upper_contacts(scene, law, **end):
    """Contacts of the balls by the exact engine: (begin, end) in s since the first floor touch, and last v1, v2."""
    log = gr.md.simulate(scene, law, engine="plain", **end).contacts
    start, rows = log["t_begin"][0], log[log["pair"] == 1]
    return np.stack([rows["t_begin"], rows["t_end"]], axis=1) - start, rows["v_out"][-1] if len(rows) else None


def matrix(scene, law, active):
    """ż = M z, z = (ξ0, ξ̇0, ξ1, ξ̇1, 1), while the contacts push that are `active`."""
    m = mpmath.zeros(5)
    m[0, 1] = m[2, 3] = 1
    m[1, 4] = mpmath.mpf(scene.gravity)
    for c in (0, 1):
        if active[c]:
            row = mpmath.matrix(push(scene, law, c)).T
            m[1 + 2 * c, 2 * c : 2 * c + 2] -= row
            if c == 0:
                m[3, 0:2] += row
    return m


def push(scene, law, c):
    """ω² and 2β of a contact."""
    mass = mpmath.mpf(float(scene.mass[c + 1]))
    return [mpmath.mpf(x) / mass for x in law[c].linear(scene.pairs[c])]


def at_touch(scene):
    """Time to the first floor contact, and the state there."""
    floor, upper, g = (mpmath.mpf(float(x)) for x in (*scene.gap, scene.gravity))
    fall, follow = (mpmath.mpf(float(x)) for x in np.diff(scene.velocity))
    rate = mpmath.sqrt(fall * fall + 2 * g * floor)
    t10 = (fall + rate) / g if g else -floor / fall
    return t10, mpmath.matrix([0, rate, -(upper + follow * t10), -follow, 1])


def events(scene, law, solution):
    """(time, pair, whether it begins) of every onset and end that is finite, not the floor's onset at 0."""
    found = [(t, 1, begins) for row in solution.contacts for t, begins in zip(row, (True, False), strict=True)]
    found += [(solution.floor_end, 0, False), (solution.floor_again, 0, True)]
    last = solution.floor_again
    if solution.ongoing:  # the floor is touched again and again, which the solution does not tell
        last = solution.t_f
        light, its_law = lighter(scene, law, 2.0**-60)
        floor = gr.md.simulate(light, its_law, t_end=solution.t10 + last, engine="plain").of(0)
        found += [(t - solution.t10, 0, begins) for row in floor[["t_begin", "t_end"]].tolist()[1:]
                  for t, begins in zip(row, (True, False), strict=True)][1:]
    return sorted((e for e in found if e[0] <= last and math.isfinite(e[0])), key=lambda e: e[0])


def check_against_limit(scene, law, tol=1e-12, solution=None):
    """Both must be the same to rounding: the approximation is the limit m2 → 0, nothing else.

    The exponential of the exact equations, in 30 digits, goes from event to event: at each of them the overlap or the
    force must be zero, and between them every force must push that is said to, and no other.
    """
    solution = solution or adiabatic.contacts(scene, law)
    happens = events(scene, law, solution)
    scale = tol * max([1e-4, *(t for t, _, _ in happens)])
    with mpmath.workdps(30):
        t10, z = at_touch(scene)
        assert solution.t10 == pytest.approx(float(t10), rel=1e-14, abs=1e-300)
        now, active = mpmath.mpf(0), [True, False]
        for t, c, begins in happens:
            check_between(scene, law, active, z, float(t - now))
            m = matrix(scene, law, active)
            z, now = mpmath.expm(m * (t - now)) * z, mpmath.mpf(t)
            assert t == 0.0 or abs(misses(scene, law, c, z, m)) < scale
            assert active[c] != begins
            active[c] = begins
            if t == solution.t_f:
                found = [float(x) for x in (-z[1], -z[1] - z[3])]
                speed = tol * abs(solution.v10 - scene.velocity[0])
                np.testing.assert_allclose([solution.v1, solution.v2], found + scene.velocity[0], rtol=0, atol=speed)
        if solution.status is Status.resting:
            assert active == [True, True]
            check_between(scene, law, active, z, 10.0 * float(now) + 1e-3)
    return solution


def misses(scene, law, c, z, m):
    """Time in s by which an event of pair `c` misses the zero of its overlap or its force, whichever is nearer."""
    square, damping = push(scene, law, c)
    rate = m * z
    force, rise = (square * x[2 * c] + damping * x[2 * c + 1] for x in (z, rate))
    times = [x / y for x, y in ((z[2 * c], rate[2 * c]), (force, rise)) if y]
    return min(times, key=abs)


def check_between(scene, law, active, z, span, points=40):
    """Inside a stretch of `span` s after `z`, contacts push that are `active`, and no other."""
    step = expm(np.array(matrix(scene, law, active).tolist(), dtype=float) * (span / points))
    z = np.array(z.tolist(), dtype=float).ravel()
    pushing = [[float(x) for x in push(scene, law, c)] for c in (0, 1)]
    for _ in range(points - 1):
        z = step @ z
        for c, (square, damping) in enumerate(pushing):
            parts = square * z[2 * c], damping * z[2 * c + 1]
            pushes = z[2 * c] > 0.0 and sum(parts) > 0.0
            small = 1e-9 * max(map(abs, parts))
            assert pushes == active[c] or abs(sum(parts)) <= small or abs(z[2 * c]) * square <= 1e-9 * scene.gravity
