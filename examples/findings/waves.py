"""Crossing waves and a light intruder: effects of the contact duration

Forty equal beads touch. If both ends are struck at the same time, two waves cross in the middle. If one end is struck
and a light bead sits in the middle, a part of the energy comes back. Both effects are measured.

:Published: Crossing waves leave small *secondary waves* behind. These are larger if the waves meet at a contact, in a
    chain with an even number of beads (Santibáñez, Muñoz, Caussarieu, Job & Melo, arXiv:1102.3364). A light intruder
    oscillates, and gaps open beside it (Job, Santibáñez, Tapia & Melo, arXiv:0901.3532).
:Hard spheres: Equal balls exchange their velocities, and no secondary wave is left. A light intruder sends back 0.0051
    of the energy at μ = 0.1 of the other masses, and 0.0519 at 0.5. A heavy intruder sends back 0.1111 at 2.
:Soft spheres: The secondary wave has 0.0238 of the first force in 40 beads, and 0.0061 in 41 beads. When all beads have
    separated, 0.0458, 0.0302 and 0.0755 of the energy have come back, with equal beads 0.0063. The light intruder has
    17 and 15 contacts with its neighbours.
:New: Secondary waves are an effect of the contact duration alone. With hard balls, the energy that a light intruder
    sends back varies between 0 and 0.15 with its mass. With soft balls it is a smooth 0.03 to 0.05. For a heavy
    intruder hard spheres give too much.
:Read: The abstracts of both papers.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

HERTZ_LAW, HARD_RULE, BEAD_RADIUS = gr.Hertz(k=1e9), gr.ConstantRestitution(1.0), 0.05


def crossing_waves(n, engine=gr.md, **options):
    """Run of n beads that are struck at both ends."""
    gap = 0.0 if engine is gr.md else 1e-6
    scene = gr.Scene([1.0] * n, [BEAD_RADIUS] * n, [gap] * (n - 1), [1.0, *[0.0] * (n - 2), -1.0])
    return engine.simulate(scene, HERTZ_LAW if engine is gr.md else HARD_RULE, **options)


def quarter_force(n, samples=1501, end=0.015):
    """Times, and the force between beads a quarter of the way along the chain."""
    run = crossing_waves(n, t_end=end, samples=samples)
    overlap = 2.0 * BEAD_RADIUS + run.position[:, n // 4] - run.position[:, n // 4 + 1]
    return run.time, HERTZ_LAW.k * np.maximum(overlap, 0.0) ** 1.5


def secondary_wave(n):
    """Height of the third peak, the secondary wave, over the first peak above 1 N."""
    push = quarter_force(n)[1]
    peaks = push[1:-1][(push[1:-1] > push[:-2]) & (push[1:-1] >= push[2:]) & (push[1:-1] > 1.0)]
    return peaks[2] / peaks[0]


def intruder_outcome(mu, engine=gr.md, n=40):
    """Energy sent back by a bead of mass mu, and its contacts on either side."""
    mass = np.where(np.arange(n) == n // 2, mu, 1.0)
    gap = 0.0 if engine is gr.md else 1e-6
    scene = gr.Scene(mass, BEAD_RADIUS * np.cbrt(mass), [gap] * (n - 1), [1.0] + [0.0] * (n - 1))
    run = engine.simulate(scene, HERTZ_LAW if engine is gr.md else HARD_RULE, until=gr.until.separated())
    return float(np.sum(run.velocity[-1, : n // 2] ** 2)), run.count(n // 2 - 1), run.count(n // 2)


if __name__ == "__main__":
    print("hard, 40 beads: largest speed between the ends", abs(crossing_waves(40, gr.edmd).velocity[-1, 1:-1]).max())
    for n in (40, 41):
        print(f"secondary wave of {n} beads: {secondary_wave(n):.4f}")
    for mu in (0.1, 0.5, 1.0, 2.0):
        soft, hard = intruder_outcome(mu), intruder_outcome(mu, gr.edmd)
        print(f"intruder of mass {mu:g}: energy sent back, contacts before and after: soft", soft, "hard", hard)
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
    for n, colour, line in ((40, "#1f4e79", "-"), (41, "#c8963e", "--")):
        time, push = quarter_force(n)
        axes[0].semilogy(1e3 * time, np.maximum(push, 1e-3) / push.max(), line, color=colour, label=f"{n} beads")
    axes[0].set(title="(a)", xlabel="time (ms)", ylabel="force at a quarter / peak", xlim=(2.0, 15.0), ylim=(1e-4, 3.0))
    axes[0].text(9.9, 0.045, "secondary waves")
    axes[0].legend(loc="upper right", ncols=2)
    for engine, c, name, many, mark in ((gr.edmd, "#c1440e", "hard", 301, "-"), (gr.md, "#1f4e79", "soft", 15, "o-")):
        masses = np.geomspace(0.05, 20.0, many)
        axes[1].loglog(masses, [intruder_outcome(mu, engine)[0] for mu in masses], mark, color=c, label=name)
    axes[1].set(title="(b)", xlabel="mass of the intruder / of the others", ylabel="energy sent back", ylim=(1e-3, 1.0))
    axes[1].legend(loc="upper left")
    figure.savefig("waves.png")
