"""Five touching balls in pymunk, compared with both models.

    pip install pymunk && python examples/peers/against_pymunk.py
"""

import pymunk

import granular as gr

scene = gr.Scene(mass=[1.0] * 5, radius=[0.05] * 5, gap=[0.0] * 4, velocity=[1.0, 0.0, 0.0, 0.0, 0.0])
space, time, rows = pymunk.Space(), [], []
for x, v in zip(scene.position, scene.velocity, strict=True):
    shape = pymunk.Circle(pymunk.Body(1.0, float("inf")), 0.05)
    shape.elasticity, shape.body.position, shape.body.velocity = 1.0, (x, 0.0), (v, 0.0)
    space.add(shape.body, shape)
for step in range(200):
    time.append(step * 1e-3)
    rows.append([(body.position.x, body.velocity.x) for body in space.bodies])
    space.step(1e-3)
theirs = gr.Trajectory.from_arrays(scene, time, position=[[x for x, _ in row] for row in rows],
                                   velocity=[[v for _, v in row] for row in rows])
apart = gr.compare(scene, gr.LinearDashpot(1e6)).against(theirs)
print(apart)
