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

plt.style.use("granular.journal")
figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
for ball in range(5, 40, 5):
    axis.plot(1e3 * run.time, run.velocity[:, ball], color="#1f4e79")
    top = run.velocity[:, ball].argmax()
    axis.annotate(f"{ball}", (1e3 * run.time[top], run.velocity[top, ball]), ha="center", va="bottom")
axis.set(xlabel="time (ms)", ylabel="velocity (m/s)", ylim=(-0.03, 0.78),
         title=r"balls 5, 10, …, 35, $F=k\,\xi^{3/2}$, striker at 1 m/s")
figure.savefig("hertz_chain.png")
