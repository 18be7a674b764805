"""A stack of balls

A stack of balls, each with a third of the mass of the ball below, falls at 3 m/s. The top ball leaves fastest.

The closed formula for its speed holds if the gaps are wider than the largest overlaps.
"""

import matplotlib.pyplot as plt

import granular as gr

balls = range(2, 8)
speed = {"closed formula": [], "gap 1 cm": [], "gap 1 µm": []}

print("balls   formula   gap 1 cm   gap 1 µm   (speed of the top ball / speed of the fall)")
for n in balls:
    for name, gap in (("gap 1 cm", 1e-2), ("gap 1 µm", 1e-6)):
        scene = gr.scenes.ball_stack(n, 1 / 3, speed=3.0, gap=gap, gravity=0.0)
        law = gr.LinearDashpot(k=5e7, gamma=0.0)
        soft = gr.md.simulate(scene, law, until=gr.until.separated())
        speed[name].append(soft.velocity[-1][-1] / 3.0)
    speed["closed formula"].append(gr.theory.stack_velocities(scene.mass[1:], 1.0)[-1])
    print(f"{n:5d}", *(f"{values[-1]:10.4f}" for values in speed.values()))

plt.style.use("granular.journal")
figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
for (name, values), mark in zip(speed.items(), ("k-", "o", "s"), strict=True):
    axis.plot(balls, values, mark, label=name)
axis.set(xlabel="number of balls", ylabel="speed of the top ball / speed of the fall")
axis.legend()
figure.savefig("kerwin_stack.png")
