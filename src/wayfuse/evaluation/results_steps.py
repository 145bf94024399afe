"""Step counts on the validation walks of oxford-steps (see `wayfuse.evaluation.step_counts`), with their bars."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from wayfuse.evaluation.results_bars import at_most
from wayfuse.evaluation.step_counts import score

__all__ = ["measure_steps"]

_HAND, _HAND_LIMIT, _ALL_LIMIT = "hand", 0.04, 0.08


def measure_steps(root: Path) -> dict[str, Any]:
    """Mean absolute relative error of the step count, by carrying position and over all walks."""
    table = score(root)
    bars = [
        at_most(
            "steps counted, phone in the hand: mean relative error", _HAND_LIMIT, table.mean_error(_HAND), "%"
        ),
        at_most("steps counted, all positions: mean relative error", _ALL_LIMIT, table.mean_error(), "%"),
    ]
    return {
        "by_position": {
            position: {
                "walks": sum(c.position == position for c in table.counts),
                "steps": sum(c.steps for c in table.counts if c.position == position),
                "found": sum(c.found for c in table.counts if c.position == position),
                "mean_error": table.mean_error(position),
            }
            for position in table.positions
        },
        "walks": len(table.counts),
        "mean_error": table.mean_error(),
        "bars": [asdict(bar) for bar in bars],
    }
