"""The domino front is not an artefact of instantaneous collisions

A cold gas of masses m, μ, m, μ, … with equal gaps d is struck at its end at speed v. In general the front slows down
like a blast. At magic mass ratios it runs forever, with three balls moving at a time. This is tested for collisions of
duration t_c.

:Published: At m/μ = M_k only one triplet moves, and the front keeps the mean speed v. Otherwise x ~ t^δ with δ < 1
    (Holovatch, Kozitsky, Pilorz & Holovatch, Phys. Rev. E 112, L052101 (2025), and arXiv:2605.16125). Such triplets
    pass on all of their energy (Ee & Lee, arXiv:1310.5200): M_k = 1/(1/cos(π/(2k+1)) - 1) = 1, 4.236, 9.098, …
:Hard spheres: The front passes a cell in exactly 2 d/v, and two balls move. At m/μ = 2 all 400 balls move, and
    δ = 0.62.
:Soft spheres: All contacts are isolated, and the front ball keeps its speed, up to v t_c/d = 0.34164 with springs and
    0.36594 with Hertz contacts (k = 2), and up to 0.11940 and 0.13568 (k = 3). Beyond these values the front ball loses
    speed in the first cells, and then hardly any.
:New: The soft domino and its limit, 3/√5 - 1 for springs and k = 2. Beyond the limit a slower domino leaves its tail
    behind.
:Read: The abstracts of all three papers. The formula of M_k is quoted from memory.
"""

import math
from bisect import bisect_left

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

SOFT_LAWS = {"springs": (gr.LinearDashpot(k=1e6, gamma=0.0), "-"), "Hertz contacts": (gr.Hertz(k=1e6), "--")}
MAGIC_RATIOS = {k: 1.0 / (1.0 / math.cos(math.pi / (2 * k + 1)) - 1.0) for k in (1, 2, 3)}


def hard_run(ratio, n, **options):
    """Run of n hard balls with gaps of 1 m, every other ball lighter by `ratio`."""
    return gr.edmd.simulate(gr.scenes.chain(n, dimer=1 / ratio, gap=1.0), gr.ConstantRestitution(1.0), **options)


def soft_run(law, k, softness, n, disturbed="resolve"):
    """Run of n soft balls with v t_c/d = `softness`, until the last but one is hit."""
    t_c = gr.binary.collision(law, gr.scenes.chain(n, dimer=1 / MAGIC_RATIOS[k]).pairs[0], speed=1.0).duration
    scene = gr.scenes.chain(n, dimer=1 / MAGIC_RATIOS[k], gap=t_c / softness)
    return gr.md.simulate(scene, law, until=gr.until.contact(n - 2), disturbed=disturbed)


def isolation_limit(law, k, digits=6):
    """Largest v t_c/d at which all contacts of the first five balls are isolated."""
    grid = np.linspace(0.0, 1.0, 10**digits + 1)[1:]
    return grid[bisect_left(grid, True, key=lambda x: soft_run(law, k, x, 5, "stop").status is gr.Status.disturbed) - 1]


def front(run):
    """Times and speeds at which each heavy ball first hits the next ball."""
    first = [run.of(pair)[0] for pair in range(0, run.scene.n_pairs - 1, 2)]
    return np.array([[hit["t_begin"], hit["v_in"][0]] for hit in first]).T


if __name__ == "__main__":
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 3, figsize=(7, 2.7), layout="constrained")
    for axis, letter, ratio in zip(axes, "ab", (2.0, MAGIC_RATIOS[2]), strict=False):
        run = hard_run(ratio, 401, until=gr.until.contact(399))
        delta = np.polyfit(np.log(front(run)[0][20:]), np.log(np.arange(41, 400, 2)), 1)[0]
        print(f"hard, m/μ = {ratio:.3f}: exponent {delta:.4f}, {np.sum(abs(run.velocity[-1]) > 1e-9)} balls moving")
        few = hard_run(ratio, 14, t_end=16.0, samples=1001)
        paths = few.position[:, :1] - few.position[0, 0] + np.cumsum(np.pad(few.gap, [(0, 0), (1, 0)]), axis=1)
        axis.plot(few.time, paths[:, 1::2], color="#c8963e", lw=1.5)
        axis.plot(few.time, paths[:, ::2], color="#c1440e", lw=1.5)
        axis.set(title=f"({letter}) hard, m/μ = {ratio:.4g}", xlabel="time (d/v)", ylabel="place (d)", ylim=(-1.5, 14))
    for name, (law, line) in SOFT_LAWS.items():
        ends, softness = [isolation_limit(law, k) for k in (2, 3)], np.linspace(0.1, 1.0, 19)
        print(f"soft, {name}: isolated up to v t_c/d = {ends[0]:.6f} (k = 2), {ends[1]:.6f} (k = 3)")
        speed = [front(soft_run(law, 2, x, 25))[1][-1] for x in softness]
        axes[2].plot(softness, speed, line, color="#1f4e79", lw=1.5, label=name)
    axes[2].text(0.1, 0.93, "all contacts\nisolated", color="#1f4e79")
    axes[2].set(title="(c) soft, m/μ = 4.236", xlabel="contact duration (d/v)", ylabel="speed of the front ball (v)",
                ylim=(0.62, 1.04))
    axes[2].legend(frameon=False, loc="lower left")
    figure.savefig("domino.png")
