"""One run of any engine: driver, stop conditions, results, files and figures.
May be skipped: names of the package only.
"""
