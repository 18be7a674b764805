"""Figure of waves.md: bands of a driven chain, and the solitary wave.

`python bench/waves.py` writes docs/figures/waves.png, which compares runs of the located engine with closed forms.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import docs_data
import numpy as np

import granular as gr
from granular._engine.reports import COLUMN_WIDTH, GREY_COLOUR, SOFT_COLOUR, add_letters, canvas, style

FIGURE_PATH = Path(__file__).parent.parent / "docs" / "figures" / "waves.png"
CHAIN_LAW, COMPRESSION_FORCE, MASS_RATIO = gr.Hertz(9.75758e9), 20.0, 0.5
THEORY_COLOUR = "#c8963e"
"""Colour of closed forms, because orange stands for hard spheres."""
SAMPLES_PER_PERIOD = 8
"""Samples per period of the highest frequency."""


def diatomic_chain(n: int, **options: Any) -> tuple[gr.Scene, float, np.ndarray]:
    """Compressed diatomic chain, its contact stiffness and the masses of a cell."""
    scene = gr.scenes.compressed_chain(n, COMPRESSION_FORCE, law=CHAIN_LAW, dimer=MASS_RATIO, **options)
    return scene, float(gr.waves.stiffness(scene, CHAIN_LAW)[1]), scene.mass[1:3]


def spectral_density(cells: int, periods: int) -> dict[str, Any]:
    """Spectral density of velocities in a chain between walls.

    The initial velocities are random.
    """
    scene, k, mass = diatomic_chain(2 * cells)
    top = gr.waves.band_edges(k, mass)[-1, 1]
    start = np.zeros(scene.n)
    start[1:-1] = np.random.default_rng(1).normal(0.0, 1e-7, 2 * cells)
    times = np.arange(periods * SAMPLES_PER_PERIOD) * (2.0 * math.pi / top / SAMPLES_PER_PERIOD)
    run = gr.md.simulate(scene.replace(velocity=start), CHAIN_LAW, t_end=times[-1], samples=times)
    # windows in time and space reduce leakage between frequencies and between phases
    heavy = run.velocity[:, 1:-1:2] * np.hanning(len(times))[:, None] * np.hanning(cells + 2)[1:-1]
    density = np.abs(np.fft.fft2(heavy)) ** 2
    folded = density[: len(times) // 2] + density[:1:-1][: len(times) // 2]
    kept = folded[: int(1.1 * periods), : cells // 2 + 1]
    return {"phase": (2.0 * math.pi * np.arange(cells // 2 + 1) / cells).tolist(),
            "frequency": (np.arange(len(kept)) * top / (2.0 * math.pi) / periods).tolist(),
            "density": (kept / kept.max()).tolist()}


def decay_rates(points: int, periods: int) -> dict[str, list[float]]:
    """Decay per ball in the band gap and above the bands, with a shaken floor."""
    scene, k, mass = diatomic_chain(16)
    edges = gr.waves.band_edges(k, mass)
    inside = [0.2, 0.8] if points < 3 else np.linspace(0.15, 0.85, points)
    gap = [edges[0, 1] + part * (edges[1, 0] - edges[0, 1]) for part in inside]
    above = [edges[1, 1] * (1.05 + 0.4 * part) for part in inside]
    omega = [float(w) for w in [*gap, *above]]
    return {"omega": omega, "decay": [measured_decay(scene, w, periods) for w in omega]}


def measured_decay(scene: gr.Scene, omega: float, periods: int) -> float:
    """Decay per ball at one frequency.

    The amplitude of the floor grows slowly, so that the floor excites only its own frequency.
    """
    turn = 2.0 * math.pi / omega

    def path(t: float) -> float:
        return 5e-11 * math.erfc((0.4 * periods * turn - t) / (0.088 * periods * turn)) * math.sin(omega * t)

    times = np.linspace((periods - 8) * turn, periods * turn, 96, endpoint=False)
    run = gr.md.simulate(scene.replace(floor=gr.walls.Motion(path)), CHAIN_LAW, t_end=periods * turn, samples=times)
    moved = run.position - run.position.mean(axis=0)
    size = np.abs((moved * np.exp(-1j * omega * times)[:, None]).mean(axis=0))
    return float(math.sqrt(size[3] / size[1]))


def solitary(balls: int) -> dict[str, Any]:
    """Forces at three contacts over the distance from the peak of the exact wave."""
    scene, wave = gr.waves.solitary(balls, 0.1, law=CHAIN_LAW), gr.waves.SolitaryWave(1.5)
    m = scene.mass[0]
    deepest = (0.1 * math.sqrt(m / CHAIN_LAW.k) / wave.peak_velocity) ** 0.8
    rate = wave.speed * math.sqrt(CHAIN_LAW.k * math.sqrt(deepest) / m)
    sensors = [8, balls // 2, balls - 8]
    times = np.unique([t for c in sensors for t in (c + 0.5 - 6.0 + np.linspace(-3.0, 3.0, 25)) / rate])
    times = times[times >= 0.0]
    run = gr.md.simulate(scene, CHAIN_LAW, t_end=float(times[-1]), samples=times)
    found: dict[str, Any] = {"sensors": sensors, "at": [], "force": []}
    for c in sensors:
        x = c + 0.5 - 6.0 - rate * times
        near = np.abs(x) <= 3.01
        found["at"].append(x[near].tolist())
        found["force"].append((run.force[near, c] / (CHAIN_LAW.k * deepest**1.5)).tolist())
    return found


def struck_chain(n: int, rows: int) -> gr.Trajectory:
    """Chain of equal balls under a constant force, struck from the left."""
    scene = gr.scenes.compressed_chain(n, COMPRESSION_FORCE, law=CHAIN_LAW, ends="forces", striker=0.03, speed=2e-3)
    return gr.md.simulate(scene, CHAIN_LAW, t_end=1.3 * gr.waves.crossing_time(scene, CHAIN_LAW), samples=rows)


def compute(points: int) -> dict[str, Any]:
    """All numbers of the figure, from short runs if `points` < 10."""
    few = points < 10
    return {"noise": spectral_density(4, 8) if few else spectral_density(32, 128),
            "decays": decay_rates(2 if few else 8, 24 if few else 160),
            "solitary": solitary(20 if few else 110)}


def draw(data: dict[str, Any]) -> Any:
    """Draw the four panels."""
    figure, axes = canvas(2.0 * COLUMN_WIDTH, 1.7 * COLUMN_WIDTH, 2, 2)
    (bands, gaps), (pulse, picture) = axes
    _, k, mass = diatomic_chain(4)
    edges = gr.waves.band_edges(k, mass) / (2.0 * math.pi)
    phase = np.linspace(0.0, math.pi, 200)
    seen = data["noise"]
    density = np.log10(np.maximum(seen["density"], 1e-6))
    image = bands.pcolormesh(seen["phase"], 1e-3 * np.array(seen["frequency"]), density, cmap="Greys",
                             shading="nearest", vmin=-3.0, vmax=0.0, rasterized=True)
    figure.colorbar(image, ax=bands, label=r"$\log_{10}$(spectral density/maximum)", extend="min")
    for branch in 1e-3 * np.atleast_2d(np.transpose(gr.waves.dispersion(phase, k, mass))) / (2.0 * math.pi):
        bands.plot(phase, branch, color=THEORY_COLOUR, ls="--")
    bands.set(xlabel="phase from cell to cell (rad)", ylabel="frequency (kHz)", xlim=(0.0, math.pi))
    omega = np.linspace(0.0, 1.5 * edges[-1, 1], 1000) * 2.0 * math.pi
    gaps.plot(omega / (2e3 * math.pi), gr.waves.decay(omega, k, mass), color=THEORY_COLOUR, ls="--", label="theory")
    gaps.plot(np.array(data["decays"]["omega"]) / (2e3 * math.pi), data["decays"]["decay"], "o", mfc="none",
              color=SOFT_COLOUR, label="soft spheres")
    for low, high in 1e-3 * edges:
        gaps.axvspan(low, high, color=GREY_COLOUR, alpha=0.15, lw=0)
    gaps.set(xlabel="frequency (kHz)", ylabel="amplitude ratio of neighbouring balls", ylim=(0.0, 1.05),
             xlim=(0.0, None))
    gaps.legend()
    x = np.linspace(-3.0, 3.0, 400)
    pulse.plot(x, gr.waves.SolitaryWave(1.5).force(x), color=THEORY_COLOUR, label="exact wave")
    near = np.abs(x) < math.pi / math.sqrt(0.4) / 2.0
    pulse.plot(x[near], np.cos(math.sqrt(0.4) * x[near]) ** 6, color=GREY_COLOUR, ls=":", label="continuum")
    marks = zip("so^", (6.0, 4.0, 2.0), *(data["solitary"][key] for key in ("sensors", "at", "force")), strict=True)
    for mark, size, contact, at, force in marks:
        pulse.plot(at, force, mark, ms=size, mew=0.6, mfc="none", color=SOFT_COLOUR, label=f"contact {contact}")
    pulse.set(xlabel="distance from the peak (diameters)", ylabel="force/peak force", yscale="log", ylim=(1e-5, 2.0))
    pulse.legend(loc="lower center")
    gr.waves.picture(struck_chain(60, 300), beyond=True, axis=picture)
    add_letters(axes.ravel())
    return figure


if __name__ == "__main__":
    with style():
        draw(compute(20)).savefig(FIGURE_PATH, dpi=200)
    docs_data.store("waves")
