"""Your own force law

A force law is a frozen dataclass with a method `force`. This law stiffens: F = k ξ (1 + ξ/a) + γ ξ̇.
"""

from dataclasses import dataclass

import granular as gr


@dataclass(frozen=True)
class Stiffening:
    """F = k ξ (1 + ξ/a) + γ ξ̇ with k in N/m, γ in kg/s and a in m."""

    k: float
    gamma: float
    a: float

    def force(self, xi, xi_dot, pair):
        return self.k * xi * (1.0 + xi / self.a) + self.gamma * xi_dot


scene = gr.scenes.bouncing_ball(height=0.5)
law = Stiffening(k=1e5, gamma=0.5, a=1e-3)
bounce = gr.binary.collision(law, scene.pairs[0], speed=3.0)
print(f"ε = {bounce.restitution:.6f}, t_c = {bounce.duration:.3e} s, largest overlap {bounce.xi_max:.3e} m")
report = gr.compare(scene, law, t_end=1.0)
print(report.verdict)

figure = report.plot()
figure.savefig("your_own_law.png")
