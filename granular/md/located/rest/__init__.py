"""Piles that come to rest, and the proof that they stay at rest.

Support modules: `equilibrium`, `general_laws`, `overdamped`, `proof`.
"""
