"""Newton's cradle

A ball hits two touching balls. With hard spheres the outcome depends on the tie rule, with soft spheres on the law.
"""

import matplotlib.pyplot as plt

import granular as gr

scene = gr.scenes.newtons_cradle(3)
answers = {}
print("speeds of the three balls, in units of the striker's speed")
for ties in ("left", "right", "newton", "poisson", "reflect"):
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(1.0), ties=ties, until=gr.until.separated())
    answers[ties] = hard.velocity[-1]
    print(f"hard, {ties:8}", answers[ties].round(3))
for name, law in (("linear", gr.LinearDashpot(k=1e9, gamma=0.0)), ("Hertz", gr.Hertz(k=2e10))):
    soft = gr.md.simulate(scene, law, until=gr.until.separated())
    answers[name] = soft.velocity[-1]
    print(f"soft, {name:8}", answers[name].round(3))

plt.style.use("granular.journal")
figure, axes = plt.subplots(1, len(answers), figsize=(7, 2), sharey=True, layout="constrained")
for axis, letter, (name, speeds) in zip(axes, "abcdefg", answers.items(), strict=True):
    axis.bar((1, 2, 3), speeds, color="#1f4e79" if name in ("linear", "Hertz") else "#c1440e")
    axis.axhline(0.0, color="black", lw=0.8)
    axis.set(title=f"({letter}) {name}", xticks=(1, 2, 3))
figure.supylabel("speed / striker's speed")
figure.supxlabel("ball")
figure.savefig("newtons_cradle.png")
