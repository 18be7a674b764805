"""Scenes and runs for other programs.

A first reader may skip: `files`, `input_file`, `table`.
"""

from granular.run.export.input_file import lammps

__all__ = ["lammps"]
