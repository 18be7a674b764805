"""A ball on a shaken plate: soft contacts double their period before hard collisions do."""

import math

import numpy as np

import granular as gr

eps, g, omega, ratio = 0.5, 9.81, 2.0 * math.pi * 50.0, 100.0
once = math.pi * (1.0 - eps) / (1.0 + eps)
doubles = math.hypot(once, 2.0 * (1.0 + eps**2) / (1.0 + eps) ** 2)
print(f"hard spheres bounce once a period from Γ = {once:.4f} on, and double it at Γ = {doubles:.4f}")
end = gr.until.contact(pair=0, nth=600)
for gamma in (1.50, 1.525, 1.54):
    plate = gr.walls.Sine.from_acceleration(gamma, omega / (2.0 * math.pi), g, phase=math.acos(once / gamma))
    scene = gr.Scene([math.inf, 1.0], [0.0, 0.0], [0.01 * plate.amplitude], [0.0, math.pi * g / omega], g, floor=plate)
    law = gr.LinearDashpot.from_restitution(eps, k=(ratio * omega) ** 2, pair=scene.pairs[0])
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(eps), until=end)
    soft = gr.md.simulate(scene, law, until=end)
    periods = [len(np.unique(gr.measures.section(run)["phase"][-8:].round(3))) for run in (hard, soft)]
    print(f"Γ = {gamma}: period {periods[0]} of hard spheres, {periods[1]} of soft ones with ω₀ = {ratio:g} ω")
