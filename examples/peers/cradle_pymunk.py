"""Five touching balls in pymunk, compared with both models.

The first ball moves, and all balls are elastic.

    pip install pymunk && python examples/peers/cradle_pymunk.py
"""

import pymunk

import granular as gr

RADIUS, STEP, COUNT = 0.05, 1e-3, 5


def velocities(speed: float, radius: float = RADIUS) -> list[float]:
    """Velocities in m/s of five touching balls after 0.2 s.

    The first ball starts with `speed` in m/s.
    """
    space = pymunk.Space()
    bodies = [pymunk.Body(1.0, float("inf")) for _ in range(COUNT)]
    for i, body in enumerate(bodies):
        shape = pymunk.Circle(body, radius)
        shape.elasticity, body.position = 1.0, (2.0 * radius * i, 0.0)
        space.add(body, shape)
    bodies[0].velocity = (speed, 0.0)
    for _ in range(200):
        space.step(STEP)
    return [float(body.velocity.x) for body in bodies]


if __name__ == "__main__":
    scene = gr.Scene([1.0] * COUNT, [RADIUS] * COUNT, [0.0] * (COUNT - 1), [1.0] + [0.0] * (COUNT - 1))
    report = gr.compare(scene, gr.Hertz(1e9))
    print(report.verdict)
    for name, values in (("pymunk", velocities(1.0)), ("hard", report.hard.velocity[-1]),
                         ("soft", report.soft.velocity[-1])):
        print(f"{name:7}", " ".join(f"{value:7.3f}" for value in values))
