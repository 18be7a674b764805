"""What soft spheres keep of a contact, for both kinds of method.
May be skipped: how contacts are noted, no physics.
"""

from __future__ import annotations

import numpy as np

COLUMNS = [
    (name, float)
    for name in ("lower_in", "upper_in", "lower_out", "upper_out", "xi_max", "force_max", "impulse")
]
"""Velocities of the lower and the upper body at onset and end in m/s, peaks in m and N, impulse in N s."""
CONTACT_ROW = np.dtype([("pair", int), ("t_begin", float), ("t_end", float), ("duration", float), *COLUMNS], align=True)
"""A contact; times in s, nan for what is still to come."""
