"""Soft spheres: Newton's equation with a contact force, `simulate(scene, law, ...) -> Trajectory`.
May be skipped: names of the package only.
"""

from granular.md.simulation import events, resume, simulate

__all__ = ["events", "resume", "simulate"]
