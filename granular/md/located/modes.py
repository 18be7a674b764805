"""Mode of a pair after an event of its contact force.

`contacts` and `jumps` use these functions for contacts in islands, `one_contact.inside` for a contact that is
integrated alone.
"""

from __future__ import annotations

from typing import Any

from granular._engine.kernels import kernel
from granular.md.located.pieces import power
from granular.md.located.records import ACTIVE, DORMANT, END, OPEN, RELOAD, RESIDUAL, TURN

UNCHANGED, FORCE_ENDS, FORCE_BEGINS = range(3)
"""Results of `clip`: mode and force still agree, the force ends, or it can begin."""


@kernel
def change_mode(pair: Any, event: int) -> None:
    """Set the mode of a pair after one of the events END, PART, TURN or RELOAD.

    After END the pair is RESIDUAL, after PART it is OPEN. TURN switches a law with memory to unloading, RELOAD back to
    loading. PART sets the overlap to exactly 0, except for a dormant pair, and RELOAD sets it to its previous maximum.
    """
    if event == END:
        pair.mode, pair.exact = RESIDUAL, 1
    elif event == TURN:
        pair.loading, pair.xi_peak, pair.eta = 0, pair.xi, min(0.0, pair.eta)
    elif event == RELOAD:
        pair.loading, pair.xi = 1, pair.xi_peak
    else:
        # a dormant pair keeps the gap at which it separates; ξ of all others is 0 up to rounding error
        pair.xi = pair.xi if pair.mode == DORMANT else 0.0
        pair.mode, pair.exact, pair.xi_peak, pair.loading = OPEN, 0, 0.0, 1


@kernel
def clip(pair: Any, laws: Any) -> int:
    """Check the force of a pair after a jump of the rate of its overlap.

    If an active pair no longer has a positive force, it becomes RESIDUAL, and the result is FORCE_ENDS. If a residual
    pair now has a positive force, the result is FORCE_BEGINS, and the caller changes the mode. Otherwise the result is
    UNCHANGED. `laws` is the `Collocation` of general laws, or None.
    """
    pair.exact = 0
    if pair.mode == ACTIVE and is_clipped(pair, laws):
        pair.mode = RESIDUAL
        return FORCE_ENDS
    return FORCE_BEGINS if pair.mode == RESIDUAL and not is_clipped(pair, laws) else UNCHANGED


@kernel
def is_clipped(pair: Any, laws: Any) -> bool:
    """Return whether the force of an overlapping pair is clipped to 0.

    This is the case if the balls separate so fast that the law gives no positive force. The result is false at overlap
    0.
    """
    if pair.xi == 0.0:
        return False
    if laws is not None:
        return laws.is_clipped(pair)  # type: ignore[no-any-return]
    return bool(pair.k * power(pair.xi, pair.s) + pair.gamma * pair.eta <= 0.0)
