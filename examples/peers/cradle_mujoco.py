"""Five touching balls in MuJoCo, compared with both models.

The first ball moves, and all balls are elastic.

    pip install mujoco && python examples/peers/cradle_mujoco.py
"""

import mujoco

import granular as gr

RADIUS, STEP, COUNT, STIFFNESS = 0.05, 1e-5, 5, 1e6
BALL = ('<body pos="{} 0 0"><joint type="slide" axis="1 0 0"/>'
        '<geom type="sphere" size="{}" mass="1" solref="{} 0" solimp="1 1 1"/></body>')


def velocities(speed: float) -> list[float]:
    """Velocities in m/s of five touching balls after 0.05 s.

    The first ball starts with `speed` in m/s. The contacts are direct springs without damping (negative `solref`).
    """
    balls = "".join(BALL.format(2.0 * RADIUS * i, RADIUS, -STIFFNESS) for i in range(COUNT))
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option timestep="{STEP}" gravity="0 0 0"/><worldbody>{balls}</worldbody></mujoco>')
    data = mujoco.MjData(model)
    data.qvel[0] = speed
    for _ in range(5000):
        mujoco.mj_step(model, data)
    return [float(v) for v in data.qvel]


if __name__ == "__main__":
    scene = gr.Scene([1.0] * COUNT, [RADIUS] * COUNT, [0.0] * (COUNT - 1), [1.0] + [0.0] * (COUNT - 1))
    report = gr.compare(scene, gr.Hertz(1e9))
    print(report.verdict)
    for name, values in (("MuJoCo", velocities(1.0)), ("hard", report.hard.velocity[-1]),
                         ("soft", report.soft.velocity[-1])):
        print(f"{name:7}", " ".join(f"{value:7.3f}" for value in values))
