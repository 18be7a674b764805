"""An elastic ball that falls 5 m in Box2D, compared with both models.

    pip install Box2D && python examples/peers/against_box2d.py
"""

import math

from Box2D import b2CircleShape, b2EdgeShape, b2FixtureDef, b2World

import granular as gr

scene = gr.Scene(mass=[math.inf, 1.0], radius=[0.0, 0.5], gap=[5.0], velocity=[0.0, 0.0], gravity=10.0)
world, rows = b2World(gravity=(0.0, -10.0)), []
world.CreateStaticBody(shapes=b2EdgeShape(vertices=[(-9.0, 0.0), (9.0, 0.0)]))
ball = world.CreateDynamicBody(position=(0.0, 5.5), fixtures=b2FixtureDef(
    shape=b2CircleShape(radius=0.5), density=1.0, restitution=1.0))
for step in range(180):
    rows.append([step / 60.0, 0.0, ball.position.y, 0.0, ball.linearVelocity.y])
    world.Step(1.0 / 60.0, 10, 10)
theirs = gr.Trajectory.from_arrays(scene, [row[0] for row in rows], position=[row[1:3] for row in rows],
                                   velocity=[row[3:] for row in rows])
apart = gr.compare(scene, gr.LinearDashpot(1e7), t_end=3.0).against(theirs)
print(apart)
