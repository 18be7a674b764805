"""Studies of many runs: sweeps, sensitivities, ensembles, thresholds and more.

`frontiers` measures errors against run times, and `extremes` the accuracy of methods in extreme scenes.

Start with: `sweeps/` and `thresholds`. Further studies: `adiabatic`, `extremes`, `frontiers` and `verification`.
Support modules: `frontier_methods`, `frontier_result`, `reference`, `reference_events`, `reference_walls`,
`threshold_result`.
"""
