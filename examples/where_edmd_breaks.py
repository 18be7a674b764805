"""Minimum gap for hard spheres

Smallest gap at which two balls dropped on a floor can be treated as hard spheres, for several restitutions.
"""

import matplotlib.pyplot as plt
import numpy as np

import granular as gr

eps = [0.5, 0.7, 0.9, 1.0]
data = gr.sweep("three-balls", {"restitution": eps, "gap": np.geomspace(1e-5, 1e-2, 61)}, "eps_ratio")
wrong = np.abs(data["eps_ratio"] - 1.0) > 0.01
for e in eps:
    widest = float(data["gap"][wrong.sel(restitution=e)].max())
    print(f"ε = {e}: gaps below {widest * 1e3:.2f} mm give an ε_eff with an error above 1 %")

plt.style.use("granular.journal")
figure, axis = plt.subplots(figsize=(4.6, 2.8), layout="constrained")
for e, line in zip(eps, ("-", "--", "-.", ":"), strict=True):
    axis.semilogx(1e3 * data["gap"], data["eps_ratio"].sel(restitution=e), line, label=f"ε = {e}")
axis.set(xlabel="gap (mm)", ylabel=r"$\varepsilon_\mathrm{eff}/\varepsilon$",
         title="two balls on a floor, R = 10 and 1 cm, k = 5·10⁷ N/m")
axis.legend()
figure.savefig("where_edmd_breaks.png")
