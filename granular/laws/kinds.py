"""Pairs that are alike: what depends on law and pair only is computed once for each different one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from granular.scene import Pair


def kinds(laws: Sequence[Any], pairs: Sequence[Pair]) -> tuple[Any, list[tuple[Any, Pair]]]:
    """Number the different (law, m_eff, r_eff) of a scene.

    Returns
    -------
    kind : (n-1,) array of int
        Which of them each pair is.
    each : list of (law, Pair)
        A law and a pair of each kind. Laws are the same if they are equal and hashable, as frozen dataclasses are.
    """
    number: dict[Any, int] = {}
    each: list[tuple[Any, Pair]] = []
    kind = np.empty(len(pairs), dtype=np.int64)
    for i, (law, pair) in enumerate(zip(laws, pairs, strict=True)):
        key = (_identity(law), pair.m_eff, pair.r_eff)
        kind[i] = number.setdefault(key, len(number))
        if len(each) < len(number):
            each.append((law, pair))
    return kind, each


def _identity(law: Any) -> Any:
    try:
        hash(law)
    except TypeError:
        return id(law)
    return law
