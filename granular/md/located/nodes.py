"""Gauss points of a step, and the matrices that take what is given there to polynomials, integrals and places between.
May be skipped: rarer, laws that are no powers.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre, Polynomial, legendre

from granular._check import Array

POINTS = 16


def _integrals(places: Array) -> Array:
    """Integrals from 0 to some places in [-1, 1] of what is given at the nodes."""
    powers = [(legendre.legint([0.0] * k + [0.5], lbnd=-1), k + 1) for k in range(POINTS)]
    primitive = [row @ legendre.legvander(places, degree).T for row, degree in powers]
    out: Array = np.array(primitive).T @ TO_LEGENDRE
    return out


_X, WEIGHT = legendre.leggauss(POINTS)
_BASIS = [Legendre.basis(k, domain=[0.0, 1.0]).convert(kind=Polynomial).coef for k in range(POINTS)]
NODES = 0.5 * (_X + 1.0)
TO_LEGENDRE = legendre.legvander(_X, POINTS - 1).T * WEIGHT * (np.arange(POINTS)[:, None] + 0.5)
TO_POWERS = np.array([np.pad(np.round(row), (0, POINTS - len(row))) for row in _BASIS])
"""Coefficients in τ of the Legendre polynomials in 2τ - 1, one per row."""
LOOKS = np.concatenate([[0.0], 0.5 * (NODES[1:] + NODES[:-1]), [1.0]])
"""Where the law is asked whether the interpolant holds: both ends, and between the nodes."""
TO_LOOKS = legendre.legvander(2.0 * LOOKS - 1.0, POINTS - 1) @ TO_LEGENDRE
"""Values there of what is given at the nodes."""
NEAR = np.array([1.0 - NODES[-1], *[1.0 / POINTS] * (POINTS - 1), 1.0 - NODES[-1]])
"""Share of the step for which each of them stands."""
INTEGRATE, INTEGRATE_TO_LOOKS = _integrals(_X), _integrals(2.0 * LOOKS - 1.0)
"""Integrals from 0 to each node, and to each look, of what is given at the nodes."""
