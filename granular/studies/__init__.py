"""Many runs: sweeps, sensitivities, ensembles, thresholds, frontiers and extremes.

A first reader may skip: `adiabatic`, `extremes`, `frontiers/`, `reference/`, `sweeps/`, `thresholds/`.
"""
