"""What stands on the site beside the documentation: the teaching page at page/, and a recorded run in the player."""

from pathlib import Path

import numpy as np

import granular as gr
from granular.app.page import live_page, player_page


def write(folder: Path) -> None:
    """Write the pages into `folder`/page, as `granular page` and `granular view` do."""
    target = folder / "page"
    target.mkdir(parents=True, exist_ok=True)
    live_page(target / "index.html")
    scene = gr.scenes.three_balls(gap=1e-4)
    law = [gr.LinearDashpot.from_restitution(0.7, k=5e7, pair=pair) for pair in scene.pairs]
    hard = gr.edmd.simulate(scene, gr.ConstantRestitution(0.7), t_end=0.5)
    floor = gr.md.simulate(scene, law, t_end=0.5, engine="plain").of(0)[0]
    hops = np.linspace(floor["t_begin"], floor["t_end"], 500)  # rows close enough for the hops to be seen
    times = np.union1d(np.linspace(0.0, 0.5, 300), hops)
    soft = gr.md.simulate(scene, law, t_end=0.5, samples=times, engine="plain")
    player_page(target / "player.html", [hard, soft], ["hard spheres", "soft spheres"], "A small ball on a large one")
