"""Kernels, records, root finding, checks and files shared by all subpackages.

Modules of this folder do not depend on scenes, laws or engines.

Start with: `flight`.
Support modules: `callables`, `check`, `compiler_state`, `describe`, `files`, `kernels`, `numba_pipeline`, `package`,
`progress`, `records`, `reports`, `roots`, `signature`.
"""
