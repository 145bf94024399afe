"""Byte scanner of ms-indoor logs, and the test for repeated Wi-Fi readings.

The scanner parses the lines it knows strictly and hands every other line back for the careful Python path, so
that both paths together equal the plain loop bit for bit: a decimal of at most 53 bits with a power of ten
within 1e22 is exact after one multiplication or division (Clinger, How to Read Floating Point Numbers
Accurately, PLDI 1990).

Eight bytes are looked at together: ``word[i]`` is the little-endian integer of the bytes i ... i + 7 (an
overlapping view that the wrapper makes), and line ends and tabs are counted by arithmetic on it (Lamport,
Multiple Byte Processing with Full-Word Instructions, CACM 1975).
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.jit import inline_kernel, uncounted_kernel
from wayfuse.core.types import Array, BoolArray, IdArray, IntArray

__all__ = ["KINDS", "mark_repeats", "scan_ms_indoor"]

Bytes: TypeAlias = NDArray[np.uint8]

# Kinds by row: what the scanner parses (0-6), then what it only counts.
KINDS = (
    "ACCELEROMETER",
    "GYROSCOPE",
    "MAGNETIC_FIELD",
    "ROTATION_VECTOR",
    "WIFI",
    "BLUE",
    "BEACON",
    "ACCELEROMETER_UNCALIBRATED",
    "GYROSCOPE_UNCALIBRATED",
    "MAGNETIC_FIELD_UNCALIBRATED",
    "BLU4",
)
_WIFI, _BLUE, _BEACON, _UNCALIBRATED, _BLU4 = 4, 5, 6, 7, 10
_TAB, _NEWLINE, _MINUS, _DOT, _ZERO, _NINE, _COLON, _HASH, _E = 9, 10, 45, 46, 48, 57, 58, 35, 69

# Each name as overlapping words: ``TYPE_WIFI<tab>`` is its first and its last eight bytes.
_LENGTH = np.array([len(f"TYPE_{name}\t") for name in KINDS])
_PLACES = np.minimum(np.arange(5) * 8, _LENGTH[:, None] - 8)
_WORDS = np.array(
    [
        [int.from_bytes(f"TYPE_{name}\t".encode()[p : p + 8], "little") for p in places]
        for name, places in zip(KINDS, _PLACES.tolist(), strict=True)
    ],
    np.uint64,
)

_U = np.uint64
_ONE, _TEN, _MANY = _U(1), _U(10), _U(18)  # more than 18 digits are never exact
_LOW7, _HIGH, _ONES = _U(0x7F7F7F7F7F7F7F7F), _U(0x8080808080808080), _U(0x0101010101010101)
_TABS, _NEWLINES = _U(0x0909090909090909), _U(0x0A0A0A0A0A0A0A0A)
_YS = _U(0x5959595959595959)
_FIVE, _TYPE = _U(0xFFFFFFFFFF), _U(int.from_bytes(b"TYPE_", "little"))
_NIBBLES, _THREES, _SIXES = _U(0xF0F0F0F0F0F0F0F0), _U(0x3333333333333333), _U(0x0606060606060606)

_EXACT = _U(1 << 53)  # integers up to here are float64
_POWERS = 10.0 ** np.arange(23)  # all exact in float64
_HEX = np.full(256, 255, np.uint8)
for _digit in range(16):
    _HEX[ord(f"{_digit:x}")] = _HEX[ord(f"{_digit:X}")] = _digit


@inline_kernel
def _equal_bytes(w: Any, pattern: Any) -> Any:
    """0x80 in every byte of a word that equals the pattern's."""
    y = w ^ pattern
    return ~(((y & _LOW7) + _LOW7) | y | _LOW7)


@inline_kernel
def _n_bytes(marks: Any) -> Any:
    """Number of bytes marked with 0x80."""
    return np.int64(((marks >> _U(7)) * _ONES) >> _U(56))


@inline_kernel
def _is_digits(w: Any) -> Any:
    """Whether all eight bytes are decimal digits."""
    return ((w & _NIBBLES) | (((w + _SIXES) & _NIBBLES) >> _U(4))) == _THREES


@inline_kernel
def _eight_digits(w: Any) -> Any:
    """Integer of eight decimal digits, the first in the lowest byte."""
    v = w & _U(0x0F0F0F0F0F0F0F0F)
    v = (v * _U(2561)) >> _U(8)  # pairs: 10 a + b
    v = ((v & _U(0x00FF00FF00FF00FF)) * _U(6553601)) >> _U(16)
    v = ((v & _U(0x0000FFFF0000FFFF)) * _U(42949672960001)) >> _U(32)
    return np.int64(v)


@inline_kernel
def _digits13(word: IdArray, i: int) -> Any:
    """Integer of 13 digits at i (Unix time in ms), -1 for anything else."""
    first, second = word[i], word[i + 5]
    value = np.int64(-1)
    if _is_digits(first) and _is_digits(second):
        value = _eight_digits(first) * 100_000 + _eight_digits(second) % 100_000
    return value


@uncounted_kernel
def _kind_at(word: IdArray, i: int) -> int:
    """Row of `KINDS` whose name stands at i, a tab behind it; -1 for any other."""
    head = word[i]
    kind = -1
    for k in range(7):
        if head == _WORDS[k, 0]:
            kind = k
            break
    if kind < 0:
        return -1
    if kind < 3 and word[i + _PLACES[kind, 4]] != _WORDS[kind, 4]:
        kind += _UNCALIBRATED
    elif kind == _BLUE and word[i + 2] != _WORDS[_BLUE, 4]:
        kind = _BLU4
    for k in range(1, 5):
        if word[i + _PLACES[kind, k]] != _WORDS[kind, k]:
            return -1
    return kind


@uncounted_kernel
def _decimal(buf: Bytes, start: int) -> tuple[float, Any]:
    """Number at ``start`` and the place behind it; place -1 where it is not plain or not exact in one operation.

    Places are unsigned inside: for others the compiler asks of each whether it counts from the end.
    """
    i = _U(start)
    negative = buf[i] == _MINUS
    if negative:
        i += _ONE
    first = i
    mantissa = _U(0)
    digit = _U(buf[i]) - _U(_ZERO)
    while digit < _TEN:
        mantissa = mantissa * _TEN + digit
        i += _ONE
        digit = _U(buf[i]) - _U(_ZERO)
    digits = i - first
    power = np.int64(0)
    if digits > _U(0) and buf[i] == _DOT:
        i += _ONE
        first = i
        digit = _U(buf[i]) - _U(_ZERO)
        while digit < _TEN:
            mantissa = mantissa * _TEN + digit
            i += _ONE
            digit = _U(buf[i]) - _U(_ZERO)
        power = -np.int64(i - first)
        digits = digits + (i - first) if power != 0 else _U(0)
    if digits == _U(0) or digits > _MANY or mantissa > _EXACT:
        return 0.0, -1
    if buf[i] == _E:
        i += _ONE
        down = buf[i] == _MINUS
        if down:
            i += _ONE
        first = i
        exponent = np.int64(0)
        while _ZERO <= buf[i] <= _NINE and i - first < _U(4):
            exponent = exponent * 10 + np.int64(buf[i] - _ZERO)
            i += _ONE
        if i == first:
            return 0.0, -1
        power += -exponent if down else exponent
    if power < -22 or power > 22:
        return 0.0, -1
    value = np.float64(np.int64(mantissa))
    value = value / _POWERS[-power] if power < 0 else value * _POWERS[power]
    return (-value if negative else value), np.int64(i)


@uncounted_kernel
def _address(buf: Bytes, i: int) -> Any:
    """48-bit hardware address ``hh:hh:hh:hh:hh:hh`` at i; the top bit set where there is none."""
    value, bad = _U(0), False
    for k in range(6):
        high, low = _HEX[buf[i + 3 * k]], _HEX[buf[i + 3 * k + 1]]
        bad = bad or (high | low) > 15 or (k < 5 and buf[i + 3 * k + 2] != _COLON)
        value = (value << _U(8)) | (_U(high) << _U(4)) | _U(low)
    return _U(1) << _U(63) if bad else value


@inline_kernel
def _field_start(buf: Bytes, stop: int) -> int:
    """Start of the field that ends before ``stop``."""
    i = stop
    while buf[i - 1] != _TAB:
        i -= 1
    return i


@uncounted_kernel
def _motion(buf: Bytes, i: int, out: Array) -> int:
    """Three numbers and an accuracy from i; the place of the line end, -1 where the line is otherwise."""
    for k in range(3):
        value, i = _decimal(buf, i)
        if i < 0 or buf[i] != _TAB:
            return -1
        out[k] = value
        i += 1
    if buf[i] == _MINUS:
        i += 1
    if _ZERO <= buf[i] <= _NINE and buf[i + 1] == _NEWLINE:
        return i + 1
    return -1


@uncounted_kernel
def _radio(buf: Bytes, word: IdArray, kind: int, stop: int, n_tabs: int, out: Array) -> tuple[int, int]:
    """Fields of a radio record, read from its end; start and stop of the identifier, -1 where one is amiss.

    n_tabs : tabs from the one behind the name on.
    """
    if kind == _WIFI:
        if n_tabs != 5 or buf[stop - 14] != _TAB:
            return -1, -1
        seen = _digits13(word, stop - 13)
        frequency_at = _field_start(buf, stop - 14)
        rssi_at = _field_start(buf, frequency_at - 1)
        frequency, j = _decimal(buf, frequency_at)
        rssi, k = _decimal(buf, rssi_at)
        if seen < 0 or j != stop - 14 or k != frequency_at - 1:
            return -1, -1
        out[0], out[1], out[2] = rssi, frequency, seen / 1000.0
        return _field_start(buf, rssi_at - 1), rssi_at - 1
    if kind == _BLUE:
        rssi_at = _field_start(buf, stop)
        rssi, k = _decimal(buf, rssi_at)
        if n_tabs != 3 or k != stop:
            return -1, -1
        out[0], out[1] = rssi, np.nan
        return _field_start(buf, rssi_at - 1), rssi_at - 1
    if n_tabs == 8:  # the newer form repeats the time at the end
        stop = _field_start(buf, stop) - 1
    elif n_tabs != 7:
        return -1, -1
    start = _field_start(buf, stop)
    rssi_at = _field_start(buf, _field_start(buf, start - 1) - 1)
    power_at = _field_start(buf, rssi_at - 1)
    power, j = _decimal(buf, power_at)
    rssi, k = _decimal(buf, rssi_at)
    if j != rssi_at - 1 or k < 0 or buf[k] != _TAB:
        return -1, -1
    out[0], out[1] = rssi, power
    return start, stop


@uncounted_kernel
def _rest(word: IdArray, start: int) -> tuple[int, int, bool]:
    """Place of the line end from ``start`` on, the tabs before it, and whether there is a Y before it."""
    i = _U(start)
    n_tabs, letters = np.int64(0), _U(0)
    w = word[i]
    ends = _equal_bytes(w, _NEWLINES)
    while ends == _U(0):
        n_tabs += _n_bytes(_equal_bytes(w, _TABS))
        letters |= _equal_bytes(w, _YS)
        i += _U(8)
        w = word[i]
        ends = _equal_bytes(w, _NEWLINES)
    below = ~ends & (ends - _ONE)
    n_tabs += _n_bytes(_equal_bytes(w, _TABS) & below)
    letters |= _equal_bytes(w, _YS) & below
    return np.int64(i) + _n_bytes(below & _HIGH), n_tabs, letters != _U(0)


@uncounted_kernel
def scan_ms_indoor(
    buf: Bytes,
    word: IdArray,
    n: int,
    line: IntArray,
    t: Array,
    values: Array,
    ids: IdArray,
    token: IntArray,
    care: IntArray,
    counts: IntArray,
) -> int:
    """Scan the whole lines in the first n bytes of ``buf``; at least 64 zeros follow them.

    word : the overlapping view of ``buf``. line, t, ids : (7, m) out, line number from 1, s, identifier (0
    where ``token`` holds its place). values : (7, m, 3) out. token : (m, 4) out, kind, row, start, stop of an
    identifier that is no address. care : (k, 3) out, line, start, stop of lines for the careful path. counts
    : (13,) in zeros, out records per kind, tokens, care lines. Returns the number of lines.
    """
    i, number, n_token, n_care = 0, 0, 0, 0
    stamp_a, stamp_b, ms = _U(0), _U(0), np.int64(-1)
    while i < n:
        start = i
        number += 1
        kind = -1
        if buf[i] != _HASH:
            if word[i] != stamp_a or word[i + 5] != stamp_b:  # seven lines in a row share their time
                stamp_a, stamp_b = word[i], word[i + 5]
                ms = _digits13(word, i)
            if ms >= 0 and buf[i + 13] == _TAB:
                kind = _kind_at(word, i + 14)
        good = False
        if 0 <= kind < _WIFI:
            stop = _motion(buf, i + 14 + _LENGTH[kind], values[counts[kind], kind])
            good = stop >= 0
            i = stop if good else i
        if not good:
            if kind >= 0:
                i += 13 + _LENGTH[kind]  # on the tab before the fields
            i, n_tabs, has_y = _rest(word, i)
            if kind >= _UNCALIBRATED:
                good = n_tabs == (3 if kind == _BLU4 else 7) and not has_y
            elif kind >= _WIFI and (kind == _WIFI or not has_y):  # a name may hold Y, and TYPE_ does
                row = counts[kind]
                first, last = _radio(buf, word, kind, i, n_tabs, values[row, kind])
                good = last > first and (word[first] & _FIVE) != _TYPE
                if good:
                    identifier = _address(buf, first) if last - first == 17 else _U(1) << _U(63)
                    if identifier >> _U(63):
                        token[n_token, 0], token[n_token, 1] = kind, row
                        token[n_token, 2], token[n_token, 3] = first, last
                        n_token += 1
                    ids[row, kind] = identifier
        if good:
            row = counts[kind]
            if kind < _UNCALIBRATED:
                line[row, kind] = number
                t[row, kind] = ms / 1000.0
            counts[kind] = row + 1
        elif i > start:
            care[n_care, 0], care[n_care, 1], care[n_care, 2] = number, start, i
            n_care += 1
        i += 1
    counts[11], counts[12] = n_token, n_care
    return number


@uncounted_kernel
def mark_repeats(t: Array, ids: IdArray, values: Array, table: IntArray, repeat: BoolArray) -> None:
    """Mark the readings that repeat an earlier one exactly (time, identifier, three values; NaN equals NaN).

    table : (2^k,) int64 of -1, at least twice as long as the readings. repeat : (n,) bool out.
    """
    mask = np.uint64(table.size - 1)
    for i in range(t.size):
        key = ids[i] * np.uint64(0x9E3779B97F4A7C15) + np.uint64(np.int64(t[i] * 1e3)) * np.uint64(
            0xC2B2AE3D27D4EB4F
        )
        slot = (key ^ (key >> np.uint64(29))) & mask
        repeat[i] = False
        while table[slot] >= 0:
            k = table[slot]
            same = ids[k] == ids[i] and t[k] == t[i]
            for j in range(3):
                a, b = values[k, j], values[i, j]
                same = same and (a == b or (a != a and b != b))  # noqa: PLR0124 (NaN)
            if same:
                repeat[i] = True
                break
            slot = (slot + np.uint64(1)) & mask
        if not repeat[i]:
            table[slot] = i
