"""Two balls dropped on a floor

Two balls are dropped on a floor. As hard spheres they collide once, as soft spheres they have four contacts.
"""

import granular as gr

scene = gr.scenes.three_balls(radii=(0.10, 0.01), gap=1e-4, height=0.6)
law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
report = gr.compare(scene, law, until=gr.until.contact(pair=0, nth=2))

print(report)
print(f"contacts of the two balls: {report.pairs[1].hard_contacts} hard, {report.pairs[1].soft_contacts} soft")

figure = report.plot()
figure.savefig("three_balls.png")
