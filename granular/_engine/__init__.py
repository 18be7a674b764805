"""Kernels, records, root finding, checks and files shared by all subpackages.

Modules of this folder do not depend on scenes, laws or engines.

Main line: `flight`.
A first reader may skip: `check`, `compiler_state`, `describe`, `files`, `kernels`, `numba_pipeline`, `package`,
`progress`, `records`, `reports`, `roots`, `signature`.
"""
