"""Many scenes in batches; each batch is written to a progress file whole or not at all, so that a run can go on."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.helpers.fuzz.judge import Verdict

BATCH = 100


@dataclass
class Tally:
    """What became of the scenes so far; `below`: seeds whose error_estimate is too low; `beyond`: how many too high."""

    scenes: int = 0
    ok: int = 0
    refused: int = 0
    unjudged: int = 0
    beyond: int = 0
    short: list[Any] = field(default_factory=list)
    below: list[int] = field(default_factory=list)

    def add(self, seed: int, verdict: Verdict) -> None:
        """Count a verdict."""
        self.scenes += 1
        if verdict.kind == "short":
            self.short.append([seed, verdict.why, repr(verdict.error)])
            return
        setattr(self, verdict.kind, getattr(self, verdict.kind) + 1)
        if verdict.kind == "ok":
            if verdict.below:
                self.below.append(seed)
            self.beyond += verdict.beyond

    def join(self, other: dict[str, Any]) -> None:
        """Add a batch."""
        for name, value in other.items():
            setattr(self, name, getattr(self, name) + value)


def run(progress: Path, first: int, scenes: int, judged: Callable[[int], Verdict]) -> Tally:
    """Judge seeds first … first + scenes - 1 in batches, skipping those in the progress file; return the sum."""
    known, total = _known(progress), Tally()
    for span in _spans(first, scenes):
        if span not in known:
            batch = Tally()
            for seed in range(*span):
                batch.add(seed, _careful(judged, seed))
            known[span] = vars(batch)
            _write(progress, [{"first": a, "beyond": b, "tally": tally} for (a, b), tally in known.items()])
        total.join(known[span])
    return total


def missing(progress: Path, first: int, scenes: int) -> bool:
    """Whether a batch of these scenes is not in the progress file."""
    return not set(_spans(first, scenes)) <= _known(progress).keys()


def _spans(first: int, scenes: int) -> list[tuple[int, int]]:
    """Batches: first seed and the seed after the last."""
    return [(start, min(start + BATCH, first + scenes)) for start in range(first, first + scenes, BATCH)]


def _known(progress: Path) -> dict[tuple[int, int], dict[str, Any]]:
    """Batches in the progress file, with their tallies."""
    lines = [json.loads(line) for line in progress.read_text().splitlines()] if progress.exists() else []
    return {(line["first"], line["beyond"]): line["tally"] for line in lines}


def _careful(judged: Callable[[int], Verdict], seed: int) -> Verdict:
    """A crash of the engine falls short."""
    try:
        return judged(seed)
    except Exception as error:
        return Verdict("short", f"{type(error).__name__}: {error}", float("inf"))


def _write(progress: Path, lines: list[Any]) -> None:
    draft = progress.with_suffix(".part")
    draft.write_text("".join(json.dumps(line, default=float) + "\n" for line in lines))
    os.replace(draft, progress)
