"""Tabulate the isolated viscoelastic collision to 17 digits.

    python bench/make_viscoelastic_table.py

The script writes `granular/laws/viscoelastic_restitution.json`. It needs mpmath and five minutes. With u = sqrt(y) and
ds = dt/u the equation y'' = -y^1.5 - b sqrt(y) y' becomes the polynomial system

    du/ds = v/2,   dv/ds = -u^4 - b u^2 v,   dt/ds = u,   u(0) = t(0) = 0, v(0) = 1.

The system is regular at first touch, so a Taylor method solves it to any number of digits. The contact ends at
u = x sqrt(-v) with x = sqrt(b). This is the condition y + b y' = 0 of zero force without its root before touch. The
solution continues analytically to x < 0.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpmath import mp  # type: ignore[import-untyped]

OUTPUT_PATH = Path(__file__).parents[1] / "granular" / "laws" / "viscoelastic_restitution.json"
PIECE_COUNT = 10  # pieces of equal length in q = sqrt(ln(1 + b))
Q_END = 5.0  # up to b = exp(25) = 7e10, beyond which the asymptotes are accurate to 3e-17
SERIES_ORDER = 20

FILE_NOTE = (
    "The isolated viscoelastic collision, tabulated by bench/make_viscoelastic_table.py: do not edit. Row i of a table "
    "holds powers of z, highest first, on the i-th of the equal pieces of 0 <= q <= q_end, on which z runs from -1 to "
    "1; q = sqrt(ln(1 + b)). Zeros in front make all rows one length. exponent: -ln(eps) / q^2; stretched_duration: "
    "(1 + b)^(2/3) t_c; deepest: (1 + b)^(2/3) xi_max / L; strongest: (1 + b)^(-2/3) F_max / (k L^1.5); series: h_k of "
    "eps = sum of h_k b^(k/2)."
)


def taylor(u0: Any, v0: Any, b: Any, order: int) -> tuple[list[Any], list[Any]]:
    """Taylor coefficients of u(s) and v(s) about a point."""
    u, v, square = [u0], [v0], []
    for n in range(order):
        square.append(mp.fdot(u, reversed(u)))
        bracket = [w + b * c for w, c in zip(square, v, strict=True)]  # u^2 + b v
        u.append(v[n] / (2 * (n + 1)))
        v.append(-mp.fdot(square, reversed(bracket)) / (n + 1))
    return u, v


def polynomial_value(coefficients: list[Any], s: Any) -> Any:
    """Value of a polynomial at s."""
    total = mp.mpf(0)
    for c in reversed(coefficients):
        total = total * s + c
    return total


def end_condition(x: Any, u: Any, v: Any) -> Any:
    """Function that falls to 0 at the end of contact: u - x sqrt(-v).

    While the overlap grows, the function is 1.
    """
    return u - x * mp.sqrt(-v) if v < 0 else mp.mpf(1)


def end_of_contact(x: Any, us: list[Any], vs: list[Any], high: Any) -> Any:
    """Time of the end of contact within a step of length `high`.

    Bisection narrows the step to the convergence range of Newton's method.
    """
    low = mp.mpf(0)
    for _ in range(20):  # to 1e-6 of the step, within the convergence range of Newton's method
        s = (low + high) / 2
        low, high = (s, high) if end_condition(x, polynomial_value(us, s), polynomial_value(vs, s)) > 0 else (low, s)
    s = high
    for _ in range(6):  # each iteration doubles the digits: from 6 to more than 300
        u, v = polynomial_value(us, s), polynomial_value(vs, s)
        slope = v / 2 - x * u * u * (u * u + x * x * v) / (2 * mp.sqrt(-v))
        s -= end_condition(x, u, v) / slope
    return s


def collide(x: Any, digits: int = 30) -> tuple[Any, Any]:
    """Restitution and duration (eps, t_c) for b = x^2, by Taylor steps in s."""
    with mp.workdps(int(digits + 15 + 8 * mp.log10(1 + abs(x)))):  # more guard digits for strong damping
        b, order = x * x, mp.dps
        u, v, t = mp.mpf(0), mp.mpf(1), mp.mpf(0)
        while True:
            us, vs = taylor(u, v, b, order)
            ts = [mp.mpf(0)] + [c / (n + 1) for n, c in enumerate(us)]
            # half the step at which one of the last two terms reaches the precision
            h = min((mp.eps / abs(c[n])) ** (mp.mpf(1) / n) for c in (us, vs) for n in (order - 1, order) if c[n]) / 2
            u, v = polynomial_value(us, h), polynomial_value(vs, h)
            if end_condition(x, u, v) <= 0:
                end = end_of_contact(x, us, vs, h)
                return -polynomial_value(vs, end), t + polynomial_value(ts, end)
            t += polynomial_value(ts, h)


def value_at_maximum(function: Callable[[Any], Any], slope: Callable[[Any], Any], high: Any) -> Any:
    """Value of a function where its slope falls through zero, within [0, `high`]."""
    low = mp.mpf(0)
    for _ in range(30):
        s = (low + high) / 2
        low, high = (s, high) if slope(s) > 0 else (low, s)
    return function(mp.findroot(slope, (low, high), tol=mp.mpf(10) ** (20 - 2 * mp.dps), verify=False))


def peaks(x: Any, digits: int = 30) -> tuple[Any, Any]:
    """Largest overlap and force (xi_max, F_max) for b = x^2, in L and k L^1.5.

    The force is F = u (u^2 + b v).
    """
    with mp.workdps(int(digits + 15 + 8 * mp.log10(1 + abs(x)))):  # more guard digits for strong damping
        b, order = x * x, mp.dps
        u, v = mp.mpf(0), mp.mpf(1)
        deepest = strongest = None
        while deepest is None or strongest is None:
            us, vs = taylor(u, v, b, order)

            def state(s: Any, us: Any = us, vs: Any = vs) -> tuple[Any, Any, Any]:
                u, v = polynomial_value(us, s), polynomial_value(vs, s)
                return u, v, u * u + b * v

            def rise(s: Any, state: Any = state) -> Any:
                u, v, bracket = state(s)
                return v * bracket / 2 + u * (u * v - b * u * u * bracket)

            h = min((mp.eps / abs(c[n])) ** (mp.mpf(1) / n) for c in (us, vs) for n in (order - 1, order) if c[n]) / 2
            if deepest is None and state(h)[1] <= 0:
                deepest = value_at_maximum(
                    lambda s, state=state: state(s)[0] ** 2, lambda s, state=state: state(s)[1], h)
            if strongest is None and rise(h) <= 0:
                strongest = value_at_maximum(lambda s, state=state: state(s)[0] * state(s)[2], rise, h)
            u, v = polynomial_value(us, h), polynomial_value(vs, h)
        return deepest, strongest


def power_coefficients(function: Callable[[Any], Any], low: Any, high: Any, nodes: int, least: float) -> list[Any]:
    """Coefficients of powers of z in [-1, 1], from values at Chebyshev nodes.

    Chebyshev terms below `least` times the first term are dropped.
    """
    angles = [mp.pi * (2 * j + 1) / (2 * nodes) for j in range(nodes)]
    values = [function((low + high + (high - low) * mp.cos(a)) / 2) for a in angles]
    cheb = [2 * mp.fdot(values, [mp.cos(n * a) for a in angles]) / nodes for n in range(nodes)]
    cheb[0] /= 2
    while abs(cheb[-1]) < least * abs(cheb[0]):
        cheb.pop()
    total, older, newer = [mp.mpf(0)] * len(cheb), [mp.mpf(1)], [mp.mpf(0), mp.mpf(1)]
    for c in cheb:
        for k, coefficient in enumerate(older):
            total[k] += c * coefficient
        twice = [mp.mpf(0)] + [2 * k for k in newer]
        older, newer = newer, [a - b for a, b in zip(twice, [*older, 0, 0], strict=True)]
    return total


def series() -> list[float]:
    """Coefficients h_k of eps = Σ h_k x^k, from values on -1/4 < x < 1/4."""
    quarter = mp.mpf(1) / 4
    h = power_coefficients(lambda x: collide(x, digits=50)[0], -quarter, quarter, nodes=64, least=0.0)
    return [float(mp.chop(c * 4**k, 1e-25)) for k, c in enumerate(h[: SERIES_ORDER + 1])]


def table(function: Callable[[Any], Any], nodes: int = 24, least: float = 3e-18) -> list[list[float]]:
    """One row of coefficients per piece, all padded to the same length.

    Equal lengths allow a compiler to treat the rows as one type.
    """
    width = mp.mpf(Q_END) / PIECE_COUNT
    rows = [power_coefficients(function, i * width, (i + 1) * width, nodes=nodes, least=least)
            for i in range(PIECE_COUNT)]
    longest = max(map(len, rows))
    return [[0.0] * (longest - len(row)) + [float(c) for c in reversed(row)] for row in rows]


def main() -> None:
    """Compute the tables and write the file."""
    known: dict[Any, tuple[Any, Any]] = {}
    tops: dict[Any, tuple[Any, Any]] = {}

    def solution(q: Any) -> tuple[Any, Any]:
        if q not in known:
            known[q] = collide(mp.sqrt(mp.expm1(q * q)))
        return known[q]

    def top(q: Any) -> tuple[Any, Any]:
        if q not in tops:
            tops[q] = peaks(mp.sqrt(mp.expm1(q * q)))
        return tops[q]

    OUTPUT_PATH.write_text(json.dumps({
        "about": FILE_NOTE, "q_end": Q_END, "exponent": table(lambda q: -mp.log(solution(q)[0]) / (q * q)),
        "stretched_duration": table(lambda q: solution(q)[1] * mp.exp(q * q * 2 / 3)),
        "deepest": table(lambda q: top(q)[0] * mp.exp(q * q * 2 / 3)),
        "strongest": table(lambda q: top(q)[1] * mp.exp(-q * q * 2 / 3), nodes=44, least=1e-17), "series": series(),
    }, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    mp.dps = 60
    main()
