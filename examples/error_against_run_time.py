"""Error against run time

Error against run time of the located method, velocity Verlet and scipy's DOP853, for one scene.
"""

import granular as gr

scene = gr.scenes.three_balls()
law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
until = gr.until.contact(pair=0, nth=2)
frontier = gr.frontier(scene, law, until=until, methods=("located", "verlet", "dop853"), repeats=1)
print(frontier)

figure = frontier.plot()
figure.savefig("error_against_run_time.png")
