"""π by counting collisions: the limit of soft balls

A ball of 1 kg rests 1 m beside a wall. A ball of 100ᵈ kg approaches at 1 m/s. The number of all collisions, including
hits of the wall, has the first digits of π. The number of correct digits is determined for collisions of
finite duration.

:Published: ⌊π 10ᵈ⌋ collisions (Galperin, Regul. Chaotic Dyn. 8, 375 (2003)).
:Hard spheres: 3, 31, 314, 3141, 31 415, 314 159, all with the first digits of π.
:Soft spheres: Springs reach 8, 26, 84, 266 contacts for k = 1e2, 1e4, 1e6, 1e8 N/m (840 for 1e10), however heavy the
    other ball is. The light ball is squeezed between ball and wall, and finally touches both all the time. Yet the
    balls separate as fast as hard balls: digits of π are lost, but not the outcome.
:New: The limit is 2.656 √(x₀ ω/V), where x₀ is the distance from the wall, V the speed of the heavy ball, and ω² = k/m
    for the light ball. The action ∮ p dx = 2 m V x₀ is conserved, flight changes into oscillation, and each period has
    two contacts.
:Read: Two accounts of Galperin's billiard on the web. His paper is quoted from memory.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

STIFFNESSES = (1e2, 1e4, 1e6, 1e8)


def balls(digits):
    """A wall, a ball at rest 1 m away, and a ball of 100**digits kg 1 m further away."""
    return gr.Scene([math.inf, 1.0, 100.0**digits], [0.0] * 3, [1.0, 1.0], [0.0, 0.0, -1.0])


def collision_count(digits, k=math.inf):
    """Number of collisions or of spring contacts, and the heavy ball's final speed."""
    if k < math.inf:
        run = gr.md.simulate(balls(digits), gr.LinearDashpot(k, gamma=0.0), log=False)
    else:
        run = gr.edmd.simulate(balls(digits), gr.ConstantRestitution(1.0), log=False)
    return run.stats["contacts" if k < math.inf else "events"], run.velocity[-1, -1]


def contact_limit(k):
    """Number of contacts with a very heavy ball, in units of ω and the ball's speed.

    Up to u² = 2 V x₀ ω/π there are u/V contacts with flights between. Then the springs overlap by s, which adds ∫
    2/T ds/V. The way back doubles both. The stiffness is 2 k in the overlap, and k beyond s/2 from the middle."""
    s = np.linspace(0.0, math.sqrt(2.0), 4001)
    half, far = s / math.sqrt(2.0), np.sqrt(1.0 + 0.5 * s**2)
    within = (np.arcsin(half) + half * np.sqrt(1.0 - half**2)) / math.sqrt(8.0)
    turn = np.arccos(s / far)
    action = 4.0 * within + 2.0 * (far**2 * turn - s * np.sqrt(far**2 - s**2))
    period, overlap = 4.0 * (np.arcsin(half) / math.sqrt(2.0) + turn), s / np.sqrt(action)
    squeezed = np.sum(np.diff(overlap) * (1.0 / period[1:] + 1.0 / period[:-1]))
    return 2.0 * math.sqrt(2.0 * math.sqrt(k)) * (1.0 / math.sqrt(math.pi) + squeezed)


if __name__ == "__main__":
    print("hard:", *(collision_count(digits)[0] for digits in range(6)))
    for k in STIFFNESSES:
        count, speed = collision_count(3, k)
        print(f"k = {k:g} N/m: {count} contacts, limit {contact_limit(k):.1f}, final speed {speed:.6f} m/s")
    plt.style.use("granular.journal")
    figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
    digits = np.arange(0.0, 3.01, 0.25)
    axes[0].loglog(100.0**digits, [collision_count(d)[0] for d in digits], color="#c1440e", label="hard, π √(M/m)")
    for k, colour, name in zip(STIFFNESSES, ("#bcd3ea", "#8fb4d9", "#4f81b0", "#1f4e79"), "²⁴⁶⁸", strict=True):
        counts = [collision_count(d, k)[0] for d in digits]
        axes[0].loglog(100.0**digits, counts, color=colour, label=f"soft, k = 10{name} N/m")
    axes[0].set(title="(a)", xlabel="mass ratio M/m", ylabel="collisions", ylim=(2.0, 6e3))
    axes[0].legend(loc="upper left")
    counts, limits = [collision_count(3, k)[0] for k in STIFFNESSES], [contact_limit(k) for k in STIFFNESSES]
    axes[1].loglog(STIFFNESSES, counts, "o", color="#1f4e79", ms=5, label="soft, M/m = 10⁶")
    axes[1].loglog(STIFFNESSES, limits, color="#c8963e", label="2.656 √(x₀ ω/V)", zorder=0)
    axes[1].set(title="(b)", xlabel="stiffness k (N/m)", ylabel="largest number of contacts")
    axes[1].legend()
    figure.savefig("pi.png")
