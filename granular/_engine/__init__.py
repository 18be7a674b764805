"""Kernels, records, roots, argument checks and files that all rooms use.

Nothing here knows scenes, laws or engines.

Main line: `flight`.
A first reader may skip: `about`, `by_reference`, `check`, `describe`, `files`, `held`, `kernels`, `lazy`,
`machine_code`, `progress`, `records`, `reports`, `roots`, `signature`.
"""
