"""Five touching balls in Box2D, compared with both models.

The first ball moves, and all balls are elastic.

    pip install Box2D && python examples/peers/cradle_box2d.py
"""

from Box2D import b2CircleShape, b2FixtureDef, b2World

import granular as gr

RADIUS, STEP, COUNT = 1.0, 1.0 / 60.0, 5


def velocities(speed: float) -> list[float]:
    """Velocities in m/s of five touching balls after 2 s.

    The first ball starts with `speed` in m/s.
    """
    world = b2World(gravity=(0.0, 0.0))
    ball = b2FixtureDef(shape=b2CircleShape(radius=RADIUS), density=1.0, friction=0.0, restitution=1.0)
    bodies = [world.CreateDynamicBody(position=(2.0 * RADIUS * i, 0.0), fixtures=ball, fixedRotation=True)
              for i in range(COUNT)]
    bodies[0].linearVelocity = (speed, 0.0)
    for _ in range(120):
        world.Step(STEP, 10, 10)
    return [float(body.linearVelocity.x) for body in bodies]


if __name__ == "__main__":
    scene = gr.Scene([1.0] * COUNT, [RADIUS] * COUNT, [0.0] * (COUNT - 1), [1.0] + [0.0] * (COUNT - 1))
    report = gr.compare(scene, gr.Hertz(1e9))
    print(report.verdict)
    for speed in (3.0, 0.5):
        print(f"Box2D, {speed} m/s", " ".join(f"{value / speed:7.3f}" for value in velocities(speed)))
    print("hard          ", " ".join(f"{value:7.3f}" for value in report.hard.velocity[-1]))
    print("soft          ", " ".join(f"{value:7.3f}" for value in report.soft.velocity[-1]))
