"""Piles that come to rest, and the proof that they stay at rest.

A first reader may skip: `equilibrium`, `overdamped`, `proof`.
"""
