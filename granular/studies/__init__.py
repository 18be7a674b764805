"""Studies of many runs: sweeps, sensitivities, ensembles, thresholds and more.

`frontiers` measures errors against run times, and `extremes` the stability of methods in extreme scenes.

A first reader may skip: `adiabatic`, `extremes`, `frontier_methods`, `frontier_result`, `frontiers`, `reference`,
`reference_events`, `reference_walls`, `sweeps/`, `threshold_result`, `thresholds`, `verification`.
"""
