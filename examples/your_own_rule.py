"""Your own collision rule

A collision rule is any function of impact speed and pair. Here ε decreases with speed, as for a soft metal.
"""

import matplotlib.pyplot as plt

import granular as gr


def soft_metal(speed, pair):
    return min(1.0, 0.8 * max(speed, 1e-9) ** -0.25)


scene = gr.scenes.bouncing_ball(height=1.0)
run = gr.edmd.simulate(scene, soft_metal, t_end=3.0, samples=600)
for row in run.of(0)[:6]:
    before, after = -row["v_in"][1], row["v_out"][1]
    print(f"t = {row['t_begin']:.4f} s: {before:.4f} m/s in, {after:.4f} m/s out, ε = {after / before:.3f}")

plt.style.use("granular.journal")
figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
axis.plot(run.time, run.gap[:, 0], color="#c1440e")
axis.set(xlabel="time (s)", ylabel="height of the ball's lowest point (m)",
         title=r"$\varepsilon=0.8\,(v/1\,\mathrm{m/s})^{-1/4}$")
figure.savefig("your_own_rule.png")
