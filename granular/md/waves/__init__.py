"""Waves in chains of touching balls: bands under a static force, solitary waves.

Support modules: `bands`, `sensors`, `solitary_wave`.
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
