"""Many runs: sweeps, sensitivities, ensembles, thresholds, frontiers and extremes.

A first reader may skip: `adiabatic`, `extremes`, `frontier_methods`, `frontier_result`, `frontiers`, `reference`,
`reference_events`, `reference_walls`, `sweeps/`, `threshold_result`, `thresholds`, `verification`.
"""
