"""A ball on a shaken plate

The bounce of soft spheres doubles its period at a smaller acceleration Γ than the bounce of hard spheres.
"""

import math

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

eps, g, omega, ratio = 0.5, 9.81, 2.0 * math.pi * 50.0, 100.0
once = math.pi * (1.0 - eps) / (1.0 + eps)
doubles = math.hypot(once, 2.0 * (1.0 + eps**2) / (1.0 + eps) ** 2)
print(f"hard spheres: one bounce per period from Γ = {once:.4f}, period doubling at Γ = {doubles:.4f}")
plt.style.use("granular.journal")
figure, axes = plt.subplots(1, 3, figsize=(7, 2.5), sharey=True, layout="constrained")
end = gr.until.contact(pair=0, nth=600)
for axis, letter, gamma in zip(axes, "abc", (1.50, 1.525, 1.54), strict=True):
    plate = gr.walls.Sine.from_acceleration(gamma, omega / (2.0 * math.pi), g, phase=math.acos(once / gamma))
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [0.01 * plate.amplitude], [0.0, math.pi * g / omega], g, floor=plate)
    law = gr.LinearDashpot.from_restitution(eps, k=(ratio * omega) ** 2, pair=scene.pairs[0])
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), until=end)
    soft = gr.md.simulate(scene, law, until=end)
    phases = [gr.measures.section(run)["phase"] for run in (hard, soft)]
    periods = [len(np.unique(phase[-8:].round(3))) for phase in phases]
    print(f"Γ = {gamma}: period {periods[0]} of hard spheres, {periods[1]} of soft spheres with ω₀ = {ratio:g} ω")
    for phase, name, colour, mark in zip(phases, ("hard", "soft"), ("#c1440e", "#1f4e79"), "o.", strict=True):
        axis.plot(phase[-40:], mark, color=colour, mfc="none", label=name)
    axis.set(title=f"({letter}) Γ = {gamma}", xlabel="last bounces")
axes[0].set_ylabel("phase of the plate (turns)")
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
figure.savefig("bouncing_on_a_plate.png")
