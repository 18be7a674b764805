"""A stack of balls, each a third of the one below, falls at 3 m/s: how fast does the top ball leave?

The closed formula holds while the gaps are wider than the contacts are deep.
"""

import granular as gr

print("balls   formula   gap 1 cm   gap 1 µm   (top ball's speed over the speed of the fall)")
for n in range(2, 8):
    launched = []
    for gap in (1e-2, 1e-6):
        scene = gr.scenes.ball_stack(n, 1 / 3, speed=3.0, gap=gap, gravity=0.0)
        law = gr.LinearDashpot(k=5e7, gamma=0.0)
        soft = gr.md.simulate(scene, law, until=gr.until.separated())
        launched.append(soft.velocity[-1][-1] / 3.0)
    formula = gr.theory.stack_velocities(scene.mass[1:], 1.0)[-1]
    print(f"{n:5d} {formula:9.4f} {launched[0]:10.4f} {launched[1]:10.4f}")
