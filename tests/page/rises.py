"""How high the top ball rises, by the Python engines; the definition is that of granular/page/physics/apex.mjs.

It is the first apex of the ball in free flight after it has been touched, all hits before that included, a run that
stops earlier being carried on. A ball that comes to rest instead rises 0.
"""

import numpy as np

import granular as gr

MERGED = 1e-4
"""Hard spheres that collide at less than this share of the impact speed stick together once the run has stopped."""
LONGEST = 1000.0
"""Falls after which a rise is given up."""


def soft_rises(report):
    """Return the rise in m of the top ball of the soft spheres; None without gravity, or if it cannot be told."""
    scene = report.scene
    if not scene.gravity:
        return None

    def simulate(t_end, samples):
        return gr.md.simulate(scene, report.law, t_end=t_end, samples=samples, max_events=3000)

    return carried_on(simulate, scene, report.soft.time[-1], [])


def hard_rises(report):
    """Return the rise in m of the top ball of the hard spheres; None without gravity, or if it cannot be told."""
    scene, hard = report.scene, report.hard
    if not scene.gravity or report.hard_options["ties"] in ("newton", "poisson", "reflect"):
        return None
    before = flights(hard, hard.contacts, scene.n - 1, float(hard.time[-1]))
    if any(v > 0.0 and v <= scene.gravity * lasting for _, v, lasting in before):
        return None  # the apex is before the stop: rare, and not sought here
    rest = scene.replace(gap=hard.gap[-1], velocity=hard.velocity[-1], origin=0.0)
    speed = MERGED * report.impact_speed

    def simulate(t_end, samples):
        return gr.edmd.simulate(
            rest, report.rule, t_end=t_end, samples=samples, max_events=3000, collapse="merge", merge_below=speed
        )

    return carried_on(simulate, rest, 0.0, [float(hard.velocity[-1][-1])] if hard.count(scene.n - 2) else [])


def carried_on(simulate, scene, start, leaving):
    """Return the first apex of the top ball of a run that is made longer until there is one."""
    fall = np.sqrt(2.0 * max(float(scene.gap[0]), 0.05) / scene.gravity)
    times = start + fall * 4.0 ** np.arange(-3, np.log(LONGEST) / np.log(4.0))
    for t_end in times:
        run = simulate(float(t_end), None)
        end = float(run.time[-1])
        free = flights(run, run.contacts, scene.n - 1, end)
        if leaving:
            first = free_until(run, scene.n - 1, end)
            free = [(0.0, leaving[0], first), *free]
        for begin, v, lasting in free:
            if v > 0.0 and v <= scene.gravity * lasting:
                at = simulate(begin + 0.5 * v / scene.gravity, np.array([begin + 0.5 * v / scene.gravity]))
                return max(0.0, float(at.gap[-1].sum()) + (0.5 * v) ** 2 / (2.0 * scene.gravity))
        if run.status.name == "resting":
            return 0.0
        if run.status.name != "time":
            return None
    return None


def flights(run, log, ball, end):
    """Return (begin, velocity, duration) of the free flights of a ball after its contacts, in order of time."""
    rows = log[(log["pair"] == ball - 1) | (log["pair"] == ball)]
    rows = rows[np.argsort(rows["t_end"], kind="stable")]
    found = []
    for k, row in enumerate(rows[~np.isnan(rows["t_end"])]):
        t, v = float(row["t_end"]), float(row["v_out"][ball - row["pair"]])
        pressed = ((rows["t_begin"] < t) & ~(rows["t_end"] <= t)).any()
        later = rows["t_begin"][k + 1 :][rows["t_begin"][k + 1 :] >= t]
        if not pressed:
            found.append((t, v, float(later.min(initial=end)) - t))
    return found


def free_until(run, ball, end):
    """Return when a ball is first touched."""
    log = run.contacts
    return float(log["t_begin"][(log["pair"] == ball - 1) | (log["pair"] == ball)].min(initial=end))
