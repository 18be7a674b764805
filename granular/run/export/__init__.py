"""Scenes and runs for other programs.
May be skipped: names of the package only.
"""

from granular.run.export.input_file import lammps

__all__ = ["lammps"]
