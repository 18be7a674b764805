"""A solitary wave

A striker hits a chain of touching steel balls. A solitary wave, about five balls wide, runs along the chain.

Its speed is proportional to v^(1/5), where v is the speed of the striker. Hard spheres do not have such a wave.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

travel = []
for speed in (0.5, 1.0):
    scene = gr.scenes.chain(40, speed=speed)
    run = gr.md.simulate(scene, gr.Hertz(k=2e10), t_end=4e-3, samples=400)
    first = np.array([run.of(c)["t_begin"][0] + 0.5 * run.of(c)["duration"][0] for c in (15, 30)])
    wave = 15 * 2 * scene.radius[0] / (first[1] - first[0])
    travel.append(wave)
    print(f"striker {speed} m/s: wave {wave:.1f} m/s, largest force {run.of(20)['force_max'][0]:.0f} N")
print(f"exponent of the wave speed: {math.log(travel[1] / travel[0], 2):.3f} (theory: 0.2)")

figure, axis = plt.subplots(figsize=(6, 3.4), layout="constrained")
for ball in range(5, 40, 5):
    axis.plot(1e3 * run.time, run.velocity[:, ball], label=f"ball {ball}")
axis.set(xlabel="time, ms", ylabel="velocity, m/s", title="struck at 1 m/s, F = k ξ^(3/2), k = 2·10¹⁰ N/m^(3/2)")
axis.legend(frameon=False, fontsize=7)
figure.savefig("hertz_chain.png")
