"""One run of any engine: driver, stop conditions, results, files and figures.

Start with: `drive`, `trajectory`.
Support modules: `contact_log`, `export`, `figures`, `films`, `levels`, `loaded_run`, `recordings`, `saved_run`,
`tables`, `until`.
"""
