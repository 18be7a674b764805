"""Results of some cells, as they come in.
May be skipped: many runs of the same engines.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from granular.sweeps.results import MISUSE, NOT_RUN, Result

REFUSED = (ValueError, ArithmeticError)
"""What a cell may raise without stopping the sweep; anything else is a mistake, of the program or the user."""


class Answers:
    """An array for every result, as wide as the largest scene so far, and the first sentence of misuse.

    Parameters
    ----------
    results : mapping
        What is asked, by name.
    count : int
        Number of cells.
    """

    def __init__(self, results: Mapping[str, Result], count: int) -> None:
        self.fill = {name: result.fill for name, result in results.items()}
        self.columns: dict[str, Any] = {"status": np.full(count, NOT_RUN)}
        self.columns |= {name: np.full((count, 0) if result.dim else count, result.fill)
                         for name, result in results.items()}
        self.refusal: tuple[int, str] | None = None

    def put(self, places: Any, columns: Mapping[str, Any]) -> None:
        """Write results of the cells at these places."""
        for name, values in columns.items():
            more = values.shape[1] - self.columns[name].shape[1] if values.ndim > 1 else 0
            if more > 0:
                wider = ((0, 0), (0, more))
                self.columns[name] = np.pad(self.columns[name], wider, constant_values=self.fill[name])
            self.columns[name][(places, *map(slice, values.shape[1:]))] = values

    def refuse(self, place: int, sentence: str) -> None:
        """Note why a cell has no answer."""
        self.columns["status"][place] = MISUSE
        self.refusal = min(self.refusal or (place, sentence), (place, sentence))

    def take(self, places: Any, others: Answers) -> None:
        """Take over the answers of the cells at these places."""
        self.put(places, others.columns)
        if others.refusal is not None:
            self.refuse(int(places[others.refusal[0]]), others.refusal[1])
