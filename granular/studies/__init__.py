"""Studies of many runs: sweeps, sensitivities, ensembles, thresholds and more.

`frontiers` measures errors against run times, and `extremes` the accuracy of methods in extreme scenes.

Support modules: `adiabatic`, `calibration`, `contact_files`, `contact_lists`, `contacts`, `extremes`,
`frontier_methods`, `frontier_result`, `frontiers`, `reference`, `reference_events`, `reference_walls`, `sweeps/`,
`threshold_result`, `thresholds`, `verification`.
"""
