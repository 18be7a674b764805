"""Waves in chains of balls that touch: bands and gaps under a static force, solitary waves without one.
May be skipped: names of the package only.
"""

from granular.md.waves.bands import (
    band_edges,
    crossing_time,
    decay,
    dispersion,
    matched_end,
    modes,
    sound_speed,
    stiffness,
)
from granular.md.waves.sensors import Pulse, picture, pulse
from granular.md.waves.solitary_wave import SolitaryWave, solitary

__all__ = [
    "Pulse", "SolitaryWave", "band_edges", "crossing_time", "decay", "dispersion", "matched_end", "modes", "picture",
    "pulse", "solitary", "sound_speed", "stiffness",
]
