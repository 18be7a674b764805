"""A cooling gas

A gas loses energy in inelastic collisions. Its energy is compared for contacts of different durations.
"""

import matplotlib.pyplot as plt

import granular as gr
from granular import measures

scene = gr.scenes.gas(n=30, length=30.0, packing=0.1, seed=2)
hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.95), t_end=10.0, samples=200)
print(f"hard spheres: {len(hard.contacts)} collisions, energy left {hard.energy()[-1] / hard.energy()[0]:.4f}")
plt.style.use("granular.journal")
figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
axis.plot(hard.time, hard.energy() / hard.energy()[0], "--", color="#c1440e", label="hard spheres")
for k, line in ((1e8, "-"), (1e5, "-."), (1e2, ":")):
    law = [gr.LinearDashpot.from_restitution(0.95, k=k, pair=pair) for pair in scene.pairs]
    soft = gr.md.simulate(scene, law, t_end=10.0, samples=200)
    left = soft.energy()[-1] / soft.energy()[0]
    print(f"k = {k:g} N/m: {len(soft.contacts)} contacts, energy left {left:.4f}, "
          f"{measures.shared_impulse(soft):.2%} of the impulse in non-binary contacts")
    axis.plot(soft.time, soft.energy() / soft.energy()[0], line, color="#1f4e79",
              label=f"soft spheres, $k=10^{len(str(k)) - 3}$ N/m")
axis.set(xlabel="time (s)", ylabel="energy left, $E/E_0$", title="30 balls in a box, ε = 0.95")
axis.legend()
figure.savefig("cooling_gas.png")
