"""Soft spheres: Newton's equation with a contact force, `simulate(scene, law, ...) -> Trajectory`."""

from granular.md.simulate import simulate

__all__ = ["simulate"]
