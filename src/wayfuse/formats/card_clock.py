"""The clock of a radio card: microseconds in 32 bits, which start anew after 71.6 minutes."""

from __future__ import annotations

__all__ = ["CardClock"]

_WRAP = 1 << 32  # µs


class CardClock:
    """Undoes the wraps of a card's clock.

    >>> clock = CardClock()
    >>> [round(clock.seconds(t)) for t in (4294000000, 500000, 400000)]
    [4294, 4295, 4295]
    """

    def __init__(self) -> None:
        self._last, self._base = 0, 0

    def seconds(self, low: int) -> float:
        """Time of a record (s) from its 32 bits (µs); a step back of less than half a wrap is no wrap."""
        if self._last - low > _WRAP // 2:
            self._base += _WRAP
        self._last = low
        return 1e-6 * (self._base + low)
