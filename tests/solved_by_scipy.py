"""Rings and pendula as soft spheres by scipy's DOP853 in positions, restarted wherever a force begins or ends."""

import math

import numpy as np

import granular as gr


def forces(scene, laws, gap, closing):
    """Contact forces of all pairs, and the functions whose sign says which of them act."""
    force, signs = [], []
    for law, pair, g, u in zip(laws, scene.pairs, gap, closing, strict=True):
        full = law.force(max(-g, 0.0), u, pair)
        force.append(full if g < 0.0 and full > 0.0 else 0.0)
        signs += [g, full if g < 0.0 else 1.0]
    return np.array(force), np.array(signs)


def solved(scene, laws, t_end):
    """Gaps and velocities at `t_end`."""
    from scipy.integrate import solve_ivp

    n, share = scene.n, 1.0 / scene.mass
    rest = scene.gap - scene.across(np.concatenate([[0.0], np.cumsum(scene.gap[: n - 1])]))
    start = np.concatenate([[0.0], np.cumsum(scene.gap[: n - 1])])  # places with the radii taken out
    hung = scene.displacement

    def state(y):
        return rest + scene.across(y[:n] + start), -scene.across(y[n:])

    def slope(t, y, acting):
        force = forces(scene, laws, *state(y))[0] * acting
        a = np.zeros(n)
        for c in range(scene.n_pairs):
            lower, upper = scene.bodies(c)
            a[lower] -= force[c] * share[lower]
            a[upper] += force[c] * share[upper]
        a += scene.fall - scene.pendulum**2 * (hung + y[:n])
        return np.concatenate([y[n:], np.where(scene.is_wall, 0.0, a)])

    t, y = 0.0, np.concatenate([np.zeros(n), scene.velocity])
    while t < t_end:
        ahead = y + 1e-9 * slope(t, y, 1.0) * t_end
        acting = forces(scene, laws, *state(ahead))[0] > 0.0
        events = []
        for i in range(2 * scene.n_pairs):
            now = forces(scene, laws, *state(ahead))[1][i]

            def crosses(t, y, *_, i=i, now=now):
                gap, closing = state(y)
                c = i // 2
                value = gap[c] if i % 2 == 0 else laws[c].force(max(-gap[c], 0.0), closing[c], scene.pairs[c])
                return value * math.copysign(1.0, now)

            crosses.terminal, crosses.direction = True, -1
            if i % 2 == 0 or now < 1.0 or acting[i // 2]:
                events.append(crosses)
        out = solve_ivp(slope, (t, t_end), y, "DOP853", rtol=1e-13, atol=1e-16, events=events, args=(acting,))
        t, y = float(out.t[-1]), out.y[:, -1]
    return state(y)[0], y[n:]


def drawn(seed, **more):
    """A random row of balls and laws."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 5))
    pairs = n - 1 + bool(more.get("ring"))
    scene = gr.Scene(np.exp(rng.uniform(-1.0, 1.0, n)), np.full(n, 0.1), rng.uniform(0.0, 0.1, pairs),
                     rng.normal(size=n), **more)  # fmt: skip
    kinds = [gr.LinearDashpot(2e3, 8.0), gr.Hertz(2e4), gr.LinearDashpot(1e3), gr.ViscoelasticHertz(2e4, 60.0)]
    return scene, [kinds[int(i)] for i in rng.integers(4, size=pairs)]
