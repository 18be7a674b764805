"""Three touching balls are hit by one of them: hard spheres give an answer per tie rule, soft spheres one per law."""

import granular as gr

scene = gr.scenes.newtons_cradle(3)
print("speeds of the three balls, in units of the striker's")
for ties in ("left", "right", "newton", "poisson", "reflect"):
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), ties=ties, until=gr.until.separated())
    print(f"hard, {ties:8}", hard.velocity[-1].round(3))
for name, law in (("linear", gr.LinearDashpot(k=1e9, gamma=0.0)), ("Hertz", gr.Hertz(k=2e10))):
    soft = gr.md.simulate(scene, law, until=gr.until.separated())
    print(f"soft, {name:8}", soft.velocity[-1].round(3))
