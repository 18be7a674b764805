"""Restitution and duration of an isolated viscoelastic collision of spheres, F = k ξ^(3/2) + γ √ξ ξ̇ ≥ 0.

In units of the length L = (m_eff v²/k)^(2/5) and the time L/v, v the approach speed, the overlap obeys

    y'' = -y^(3/2) - b √y y',   y(0) = 0, y'(0) = 1,   b = γ k^(-3/5) m_eff^(-2/5) v^(1/5),

until the force vanishes at y + b y' = 0, before y does. So ε = -y' depends on b alone and falls with speed. It is
analytic in x = √b: ε = 1 + h2 x² + h4 x⁴ + h5 x⁵ + … (Schwager & Pöschel 1998, 2008), and ε → (3/2)^(2/3) b^(-5/3)
for strong damping. `restitution` and `duration` come from a table of the solution itself, the file beside
this one, made by ``bench/make_viscoelastic_table.py`` with 30 digits: in q = √ln(1 + b) both the effective exponent
K(q) of ε = (1 + b)^(-K) and (1 + b)^(2/3) t_c are smooth from b = 0 (K = 1.1534) to infinity (K = 5/3).

`peaks` are tabled likewise. All are kernels, so that compiled engines can call them, and leave b unchecked: b < 0 is a
math domain error.

Two approximations from the literature go by their names: `restitution_series` and `restitution_pade`.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

from granular._engine import check
from granular._engine.kernels import kernel

_TABLE = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
EXPONENT, STRETCHED_DURATION, DEEPEST, STRONGEST = (
    tuple(map(tuple, _TABLE[name])) for name in ("exponent", "stretched_duration", "deepest", "strongest")
)
Q_END: float = _TABLE["q_end"]
SERIES: tuple[float, ...] = tuple(_TABLE["series"])
PIECES_PER_Q = len(EXPONENT) / Q_END
LAST_PIECE = len(EXPONENT) - 1
LOSS_END = Q_END * Q_END * math.fsum(EXPONENT[-1])  # -ln ε where the table ends
TURNING = math.pow(1.5, 2.0 / 3.0)  # b^(2/3) y where strong damping stops the approach
STRONGEST_END = 0.75 * math.pow(0.375, 1.0 / 3.0)  # b^(-2/3) F where the approach is still hardly stopped
DRIFT = 1.5 * math.log(3.0) - math.log(1.5) / 3.0 - math.pi * math.sqrt(3.0) / 6.0

H2, H4, H5 = SERIES[2], SERIES[4], SERIES[5]
PADE_C1 = H5 / (H2 * H2 - H4)
PADE_B4 = H2 * H2 - H4


@kernel
def restitution(b: float) -> float:
    """Return ε of an isolated collision for any damping b ≥ 0 (dimensionless, see the module).

    Relative error, measured against 20-digit solutions at 150 random b from 1e-6 to 1e12: 2e-16 for b ≤ 1, growing
    as 2e-16 ln(1/ε) to 7e-15 at the table's end, b = 7e10; beyond it the asymptote errs by 2e-15.
    """
    log_b1 = math.log1p(b)
    q = math.sqrt(log_b1)
    if not q < Q_END:
        return TURNING * math.pow(b, -5.0 / 3.0)
    piece, z = _place(q)
    return math.exp(-log_b1 * _horner(EXPONENT[piece], z))


@kernel
def duration(b: float) -> float:
    """Return the duration of the contact, t_c v / L, for any damping b ≥ 0: 3.218 at b = 0, then falling.

    For strong damping b^(2/3) t_c √Y → (10/3) ln b + const, Y = (3/2)^(2/3). Relative error: 2e-16 for
    b ≤ 1, 2e-15 at most.
    """
    log_b1 = math.log1p(b)
    q = math.sqrt(log_b1)
    if not q < Q_END:
        return (10.0 / 3.0 * math.log(b) + DRIFT) / math.sqrt(TURNING) * math.pow(b, -2.0 / 3.0)
    piece, z = _place(q)
    return math.exp(-2.0 / 3.0 * log_b1) * _horner(STRETCHED_DURATION[piece], z)


@kernel
def peaks(b: float) -> tuple[float, float]:
    """Return the largest overlap, in L, and the largest force, in k L^(3/2): 1.0934 and 1.1433 at b = 0.

    Relative error: 2e-15 at most.
    """
    log_b1 = math.log1p(b)
    q, scale = math.sqrt(log_b1), math.exp(2.0 / 3.0 * log_b1)
    if not q < Q_END:
        scale = math.pow(b, 2.0 / 3.0)
        return TURNING / scale, STRONGEST_END * scale
    piece, z = _place(q)
    return _horner(DEEPEST[piece], z) / scale, _horner(STRONGEST[piece], z) * scale


@kernel
def _place(q: float) -> tuple[int, float]:
    """Return the piece of the tables that q lies on, and where on it, from -1 to 1."""
    position = q * PIECES_PER_Q
    piece = min(int(position), LAST_PIECE)
    return piece, 2.0 * (position - piece) - 1.0


@kernel
def _horner(row: tuple[float, ...], z: float) -> float:
    total = 0.0
    for c in row:
        total = total * z + c
    return total


def damping(restitution: float) -> float:
    """Return the damping b of an isolated collision with the given restitution in (0, 1], the inverse of `restitution`.

    A given ε close to 1 costs no digits: b is right to rounding for the very double given. Relative error at most
    4e-15, at b = 7e10.
    """
    eps = check.number("restitution", restitution, above=0.0, at_most=1.0)
    loss = 0.0 - math.log(eps)  # no -0
    if loss > LOSS_END:
        return math.pow(TURNING / eps, 0.6)
    before, miss_before, log_b1 = 0.0, loss, 0.6 * loss  # secant method for K ln(1 + b) = loss; K < 5/3
    for _ in range(20):
        piece, z = _place(math.sqrt(log_b1))
        miss = loss - log_b1 * _horner(EXPONENT[piece], z)
        if miss == miss_before:
            break
        step = miss * (log_b1 - before) / (miss_before - miss)
        before, miss_before, log_b1 = log_b1, miss, log_b1 + step
        if abs(step) <= 1e-11 * log_b1:
            break
    return math.expm1(log_b1)


def restitution_series(b: float, order: int = 5) -> float:
    """Return ε as the series Σ h_k x^k, k ≤ `order` ≤ 20, x = √b, which serves weak damping only.

    Its error passes 1e-3 at b = 0.12 (ε = 0.88) for order 5, the usual one, 0.36 (0.68) for order 10 and 0.76 (0.47)
    for order 20; 1e-6 at b = 0.012, 0.098 and 0.48. Near b = 1 more terms no longer help.
    """
    order = check.whole("order", order, at_most=len(SERIES) - 1)
    return _horner(SERIES[order::-1], math.sqrt(check.number("b", b, at_least=0.0)))


def restitution_pade(b: float) -> float:
    """Return ε as the Padé form [1/4] in x = √b that has the series' terms up to x⁵ (Müller & Pöschel 2011).

    Never too small; largest error 8.64e-3 at b = 3.01 (ε = 0.133). It falls as b^(-3/2), too slowly: 1.2 % too large
    at b = 1, 20 % at 10, a factor 3.4 at 1e4.
    """
    x = math.sqrt(check.number("b", b, at_least=0.0))
    below = 1.0 + x * (PADE_C1 + x * (-H2 + x * (-PADE_C1 * H2 + x * PADE_B4)))
    return (1.0 + PADE_C1 * x) / below
