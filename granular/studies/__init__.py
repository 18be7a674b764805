"""Many runs: sweeps, sensitivities, ensembles, thresholds, frontiers and extremes.
May be skipped: names of the package only.
"""
