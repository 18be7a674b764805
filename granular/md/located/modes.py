"""Mode of a pair after an event of its force.

`contacts` and `jumps` use these functions for contacts in islands, `one_contact.inside` for a contact that is
integrated alone.
"""

from __future__ import annotations

from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, DORMANT, END, OPEN, RELOAD, RESIDUAL, TURN

UNCHANGED, FORCE_ENDS, FORCE_BEGINS = range(3)
"""Results of `clip`: the force continues as it was, it ends, or it can begin."""


@kernel
def change_mode(pair: Any, event: int) -> None:
    """Give a pair the mode that follows END, PART, TURN or RELOAD.

    After END the pair is RESIDUAL, after PART it is OPEN. TURN switches a law with memory to unloading, RELOAD back to
    loading.
    """
    if event == END:
        pair.mode, pair.exact = RESIDUAL, 1
    elif event == TURN:
        pair.loading, pair.xi_peak, pair.eta = 0, pair.xi, min(0.0, pair.eta)
    elif event == RELOAD:
        pair.loading, pair.xi = 1, pair.xi_peak
    else:
        # a dormant pair keeps the gap at which it separates, all others separate at ξ = 0
        pair.xi = pair.xi if pair.mode == DORMANT else 0.0
        pair.mode, pair.exact, pair.xi_peak, pair.loading = OPEN, 0, 0.0, 1


@kernel
def clip(pair: Any, laws: Any) -> int:
    """Make a pair RESIDUAL whose force ends because its rate has jumped.

    Returns FORCE_ENDS in this case, FORCE_BEGINS if the force of a residual pair is no longer clipped, else UNCHANGED.
    """
    pair.exact = 0
    if pair.mode == ACTIVE and is_clipped(pair, laws):
        pair.mode = RESIDUAL
        return FORCE_ENDS
    return FORCE_BEGINS if pair.mode == RESIDUAL and not is_clipped(pair, laws) else UNCHANGED


@kernel
def is_clipped(pair: Any, laws: Any) -> bool:
    """Return whether overlapping balls separate so fast that their force is clipped."""
    if pair.xi == 0.0:
        return False
    if laws is not None:
        return laws.is_clipped(pair)  # type: ignore[no-any-return]
    return bool(pair.k * power(pair.xi, pair.s) + pair.gamma * pair.eta <= 0.0)
