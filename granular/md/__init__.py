"""Soft spheres: Newton's equation with a contact force, `simulate(scene, law, ...) -> Trajectory`."""

from granular.md.simulate import resume, simulate

__all__ = ["resume", "simulate"]
