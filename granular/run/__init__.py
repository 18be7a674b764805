"""One run of any engine: driver, stop conditions, results, files and figures.

Main line: `drive`, `trajectory`.
A first reader may skip: `contact_log`, `export`, `figures`, `films`, `levels`, `saved_run`, `tables`, `until`.
"""
