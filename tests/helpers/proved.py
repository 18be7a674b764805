"""Soft spheres of linear laws, proved: every number is a ball of python-flint that holds the true one.

What enters is enclosed too: decimal numbers, masses from radii, the damping that a restitution asks for. A piece is the
Taylor series of ẏ = M y + b of the pairs in contact, y = (ξ, η), its remainder bounded by a norm of M; exact zeros at
the front, of a contact that has just begun or ended, are divided out before a sign is asked for. A root is the first by
a range without zero before it, and the only one by the sign of the slope; then interval Newton steps narrow it. What is
undecided is begun anew with twice the digits.

Nothing of the package is used.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

OPEN, ACTIVE, RESIDUAL = "open", "active", "residual"
DEEPEST = 200
"""Halvings of an interval before it is given up."""


class Undecided(ArithmeticError):
    """More digits are needed."""


@dataclass
class Motion:
    """One scene on a line, bottom to top.

    Attributes
    ----------
    inverse : list of ball
        1/m of every body in 1/kg, exactly 0 of a wall.
    k, gamma : lists of balls
        Of every pair, in N/m and kg/s.
    xi, eta : lists of balls
        Overlap = -gap in m and its rate in m/s of every pair; exactly 0 where balls touch, or go together.
    g : ball
        Gravity in m/s².
    """

    inverse: list[Any]
    k: list[Any]
    gamma: list[Any]
    xi: list[Any]
    eta: list[Any]
    g: Any
    time: Any = None
    mode: list[str] = field(default_factory=list)
    log: list[list[Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        from flint import arb

        self.time, self.at = arb(0), dict[int, str]()
        self.mode = [self._first(c) for c in range(len(self.xi))]

    def _first(self, c: int) -> str:
        """The mode of a pair at the start."""
        touches = self.xi[c].is_zero()
        if (not touches and self.xi[c] < 0) or (touches and self.eta[c] < 0):
            return OPEN
        if touches and self.eta[c] > 0:
            self._begins(c)
            return ACTIVE
        if touches and self.eta[c].is_zero():
            return OPEN  # until the series says whether it closes
        raise Undecided("an overlap, or a gap whose sign is not known")

    def _begins(self, c: int) -> None:
        self.log.append([c, self.time, None, self.speeds(), None])

    def speeds(self) -> list[Any]:
        """Velocities in m/s of all bodies less that of the first."""
        speed = [0 * self.eta[0]]
        for eta in self.eta:
            speed.append(speed[-1] - eta)
        return speed

    # --- one piece

    def series(self, terms: int) -> list[tuple[list[Any], list[Any]]]:
        """Taylor coefficients (of ξ, of η) up to a power of the time."""
        n, y = len(self.xi), [(list(self.xi), list(self.eta))]
        for power in range(1, terms + 1):
            xi, eta = y[-1]
            force = [self.k[c] * xi[c] + self.gamma[c] * eta[c] if self.mode[c] == ACTIVE else 0 * self.g
                     for c in range(n)]
            for c in self.at if power == 1 else ():
                force[c] = 0 * self.g  # exactly, where it has just vanished
            more = []
            for c in range(n):
                below, above = self.inverse[c], self.inverse[c + 1]
                rate = -(below + above) * force[c]
                if c > 0:
                    rate += below * force[c - 1]
                if c + 1 < n:
                    rate += above * force[c + 1]
                if power == 1:
                    rate += self.g * (int(not above.is_zero()) - int(not below.is_zero()))
                more.append(rate / power)
            y.append(([one / power for one in eta], more))
        return y

    def norm(self) -> tuple[Any, Any]:
        """A bound μ in 1/s of M in the norm max(|ξ|, |η|/ω), and ω in 1/s; 0 without a contact."""
        stiff = damp = 0 * self.g
        for c in range(len(self.xi)):
            row_k = row_g = 0 * self.g
            for other, weight in ((c - 1, self.inverse[c]), (c, self.inverse[c] + self.inverse[c + 1]),
                                  (c + 1, self.inverse[c + 1])):
                if 0 <= other < len(self.xi) and self.mode[other] == ACTIVE:
                    row_k, row_g = row_k + weight * self.k[other], row_g + weight * self.gamma[other]
            stiff, damp = stiff.max(row_k), damp.max(row_g)
        omega = stiff.sqrt()
        return omega + damp, omega

    def step(self, end: Any, share: float) -> bool:
        """Go on to the next event, or by a piece, or to `end` in s; return whether that is reached."""
        from flint import arb, ctx

        mu, omega = self.norm()
        left = end - self.time
        if mu.is_zero():
            terms, h = 2, left
        else:
            terms = 16 + ctx.prec // 4
            h = arb((share / mu).mid())
        last = bool(mu.is_zero() or left <= h)
        if not last and not left > h:
            raise Undecided("whether the end is in this piece")
        h = left if last else h
        y = self.series(terms)
        size = arb(0)
        for c in range(len(self.xi)):
            size = size.max(abs(y[-1][0][c]))
            if not mu.is_zero():
                size = size.max(abs(y[-1][1][c]) / omega)
        # what is beyond the series: |y_N| h^N Σ (μh/N)^j, and of its slope |y_N| h^(N-1) μh Σ (μh/N)^j
        reach, ratio = h.upper(), (mu * h).upper()
        rest = arb(0) if mu.is_zero() else size * reach**terms / (1 - ratio / terms)
        first, what = h, None
        functions = self._functions(y, omega)
        for c, kind, _, _ in functions:
            if kind == "closes":  # now
                self._change(c, kind)
                return False
        for c, kind, function, weight in functions:
            root = first_root(function, weight * rest * ratio, first.upper(), ratio)
            if root is not None:
                if what is not None and root.overlaps(first):
                    raise Undecided("two events at once")
                if what is None or root < first:
                    first, what = root, (c, kind)
        tau = h if what is None else first
        pad = arb(0, (rest * ratio).upper())
        self.xi = [evaluate([one[0][c] for one in y], tau) + pad for c in range(len(self.xi))]
        self.eta = [evaluate([one[1][c] for one in y], tau) + pad * omega for c in range(len(self.xi))]
        self.time, self.at = self.time + tau, {}
        if what is not None:
            self._change(*what)
        return last and what is None

    def _functions(self, y: list[Any], omega: Any) -> list[tuple[int, str, list[Any], Any]]:
        """What must keep its sign in a piece: pair, event, coefficients, and what a unit of the norm makes of it."""
        found = []
        for c, mode in enumerate(self.mode):
            xi = [one[0][c] for one in y]
            if mode == OPEN:
                zeros = next((i for i, one in enumerate(xi) if not one.is_zero()), None)
                if zeros is None:
                    continue  # they go on together
                if zeros and xi[zeros] > 0:
                    found.append((c, "closes", [], 1 + 0 * omega))
                    continue
                found.append((c, "touches", xi, 1 + 0 * omega))
                continue
            force = [self.k[c] * one + self.gamma[c] * two for one, two in
                     zip(xi, (one[1][c] for one in y), strict=True)]
            if c in self.at:
                force[0] = 0 * self.g
            found.append((c, "ends" if mode == ACTIVE else "again", force, self.k[c] + self.gamma[c] * omega))
            if mode == RESIDUAL:
                found.append((c, "parts", xi, 1 + 0 * omega))
        return found

    def _change(self, c: int, event: str) -> None:
        """What an event does."""
        zero = 0 * self.g * 0
        if event in ("touches", "closes"):
            self.xi[c], self.mode[c] = zero, ACTIVE
            if event == "touches" and not self.eta[c] > 0:
                raise Undecided("a touch whose rate is not known")
            self._begins(c)
        elif event == "parts":
            self.xi[c], self.mode[c] = zero, OPEN
        elif event == "again":
            self.mode[c], self.at = ACTIVE, {c: event}
            self._begins(c)
        else:
            row = next(row for row in reversed(self.log) if row[0] == c)
            row[2], row[4] = self.time, self.speeds()
            if self.gamma[c].is_zero():
                self.xi[c], self.mode[c] = zero, OPEN
            else:
                self.mode[c], self.at = RESIDUAL, {c: event}


def evaluate(a: list[Any], t: Any) -> Any:
    """Σ a_n t^n."""
    value = 0 * t
    for one in reversed(a):
        value = value * t + one
    return value


def first_root(function: list[Any], rest: Any, h: Any, ratio: Any) -> Any:
    """The first zero in (0, h] of a series with a remainder up to `rest` at h, a ball; None if there surely is none.

    Zeros at 0 are divided out: of the series, and of its remainder, which they make larger by h^-m.
    """
    from flint import arb

    zeros = next((i for i, one in enumerate(function) if not one.is_zero()), None)
    if zeros is None:
        raise Undecided("a function without a sign")
    a = function[zeros:]
    slope = [i * one for i, one in enumerate(a)][1:] or [arb(0)]
    pad = arb(0, (rest / h**zeros).upper())
    pads = arb(0, (rest * len(function) * (1 + ratio) / h ** (zeros + 1)).upper())
    if not (a[0] > 0 or a[0] < 0):
        raise Undecided("the sign at the start")
    up = bool(a[0] < 0)
    todo = [(arb(0), h, 0)]
    while todo:
        low, high, depth = todo.pop()
        both = low.union(high)
        middle = both.mid()
        rate = evaluate(slope, both) + pads
        value = evaluate(a, middle) + pad + rate * (both - middle)
        if value > 0 or value < 0:
            continue
        if rate > 0 or rate < 0:
            there = evaluate(a, high) + pad
            if (there < 0) if up else (there > 0):
                continue
            if (there > 0) if up else (there < 0):
                return narrowed(a, pad, slope, pads, both)
        if depth == DEEPEST:
            raise Undecided("a root, or none")
        todo += [(middle, high, depth + 1), (low, middle, depth + 1)]
    return None


def narrowed(a: list[Any], pad: Any, slope: list[Any], pads: Any, root: Any) -> Any:
    """The zero that is the only one in a ball, by interval Newton steps for as long as they help."""
    while True:
        middle = root.mid()
        new = (middle - (evaluate(a, middle) + pad) / (evaluate(slope, root) + pads)).intersection(root)
        if not new.rad() < root.rad() * 0.9:
            return new
        root = new


def damping(restitution: Any) -> Any:
    """ζ of a dashpot clipped at 0 with this restitution, exp(-2 ζ f(ζ)): with L = -ln(ε)/2, ζ = cos y where
    y cot y = L < 1, ζ = cosh y where y coth y = L > 1. The root is enclosed by signs at both ends."""
    from flint import arb, ctx

    length = -restitution.log() / 2
    if (restitution - 1).is_zero():
        return arb(0)
    if length < 1:
        low, high, function, zeta = arb(0), arb.pi() / 2, lambda y: length - y * y.cot(), lambda y: y.cos()
    elif length > 1:
        low, high, function, zeta = arb(0), length + 1, lambda y: y * y.coth() - length, lambda y: y.cosh()
    else:
        raise Undecided("the critical damping")
    low, high = low.mid(), high.mid() + high.rad()
    for _ in range(ctx.prec):  # the function rises from below 0 to above 0
        middle = ((low + high) / 2).mid()
        value = function(middle)
        if value > 0:
            high = middle
        elif value < 0:
            low = middle
        else:
            break
    width, enclosed = (middle / 2 ** (ctx.prec // 3)).mid(), None
    for _ in range(ctx.prec):
        if not (function((middle - width).mid()) < 0 and function((middle + width).mid()) > 0):
            break
        enclosed, width = (middle - width).union(middle + width), (width / 2).mid()  # proved at both ends
    if enclosed is None:
        raise Undecided("the damping")
    return zeta(enclosed)


def proved(make: Any, ask: Any, bits: int = 128) -> Any:
    """Return what is asked of a motion that is made anew with twice the digits until all is decided."""
    from flint import ctx

    before = ctx.prec
    try:
        while bits <= 4096:
            ctx.prec = bits
            for share in (2.0, 1.7):
                try:
                    return ask(make(), share)
                except Undecided:
                    continue
            bits *= 2
    finally:
        ctx.prec = before
    raise Undecided("with 4096 bits")
