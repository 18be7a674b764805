"""Two balls that fall on a floor in MuJoCo, compared with both models.

The spring of an isolated contact in MuJoCo is k = m_eff · 1e5 s⁻² here. With a gap of 1e-3 m between the balls,
contacts overlap in time. Each contact then gets the acceleration of an isolated contact, and velocities differ from
soft spheres by 0.32 of the unit.

    pip install mujoco && python examples/peers/against_mujoco.py
"""

import math

import mujoco
import numpy as np

import granular as gr

scene = gr.Scene(mass=[math.inf, 1.0, 0.3], radius=[0.0, 0.1, 0.06], gap=[0.5, 0.1], velocity=[0.0] * 3, gravity=9.81)
law = [gr.LinearDashpot(1e5 * pair.m_eff, 20.0 * pair.m_eff) for pair in scene.pairs]
balls = "".join(f'<body pos="0 0 {x}"><joint type="slide" axis="0 0 1"/><geom size="{r}" mass="{m}"/></body>'
                for x, r, m in zip(scene.position[1:], scene.radius[1:], scene.mass[1:], strict=True))
model = mujoco.MjModel.from_xml_string(
    '<mujoco><option timestep="1e-5" gravity="0 0 -9.81"/><default><geom solref="-1e5 -20" solimp="1 1 1"/></default>'
    f'<worldbody><geom type="plane" size="1 1 1"/>{balls}</worldbody></mujoco>')
data, rows = mujoco.MjData(model), []
for step in range(60_000):
    if step % 600 == 0:
        rows.append([data.time, 0.0, *(scene.position[1:] + data.qpos), 0.0, *data.qvel])
    mujoco.mj_step(model, data)
rows = np.array(rows)
theirs = gr.Trajectory.from_arrays(scene, rows[:, 0], position=rows[:, 1:4], velocity=rows[:, 4:])
apart = gr.compare(scene, law, t_end=0.6).against(theirs)
print(apart)
