"""Byte scanner of ms-indoor logs, and the test for repeated Wi-Fi readings.

The scanner parses the lines it knows strictly and hands every other line back for the careful Python path, so that
both paths together equal the plain loop bit for bit: a decimal of at most 53 bits with a power of ten within 1e22 is
exact after one multiplication or division (Clinger, How to Read Floating Point Numbers Accurately, PLDI 1990).
"""

from __future__ import annotations

import numpy as np

from wayfuse.core.jit import inline_kernel, kernel

__all__ = ["KINDS", "NAMES", "mark_repeats", "scan_ms_indoor"]

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
NAMES = np.zeros((len(KINDS), 32), np.uint8)
for _row, _name in enumerate(KINDS):
    NAMES[_row, : len(_name)] = np.frombuffer(_name.encode(), np.uint8)

_TAB, _NEWLINE, _MINUS, _DOT, _ZERO, _NINE, _COLON = 9, 10, 45, 46, 48, 57, 58
_EXACT = 1 << 53  # integers up to here are float64
_POWERS = 10.0 ** np.arange(23)  # all exact in float64
_WIFI, _BLUE, _BEACON, _BLU4 = 4, 5, 6, 10


@inline_kernel
def _kind_at(buf, i):  # type: ignore[no-untyped-def]
    """Row of `KINDS` whose name stands at i, followed by a tab; -1 for any other."""
    c = buf[i]
    kind = -1
    if c == 65:  # A
        kind = 0 if buf[i + 13] == _TAB else 7
    elif c == 71:  # G
        kind = 1 if buf[i + 9] == _TAB else 8
    elif c == 77:  # M
        kind = 2 if buf[i + 14] == _TAB else 9
    elif c == 82:  # R
        kind = 3
    elif c == 87:  # W
        kind = _WIFI
    elif c == 66:  # B
        kind = _BEACON if buf[i + 1] == 69 else (_BLUE if buf[i + 3] == 69 else _BLU4)
    if kind >= 0:
        j = 0
        while NAMES[kind, j] != 0 and buf[i + j] == NAMES[kind, j]:
            j += 1
        if NAMES[kind, j] != 0 or buf[i + j] != _TAB:
            kind = -1
    return kind


@kernel
def _decimal(buf, i):  # type: ignore[no-untyped-def]
    """Number at i and the place behind it; place -1 where it is not plain or not exact in one operation."""
    negative = buf[i] == _MINUS
    if negative:
        i += 1
    first = i
    mantissa = np.int64(0)
    while _ZERO <= buf[i] <= _NINE:
        mantissa = mantissa * 10 + np.int64(buf[i] - _ZERO)
        i += 1
    digits = i - first
    power = 0
    if digits and buf[i] == _DOT:
        i += 1
        first = i
        while _ZERO <= buf[i] <= _NINE:
            mantissa = mantissa * 10 + np.int64(buf[i] - _ZERO)
            i += 1
        power = first - i
        digits += i - first
        if power == 0:
            digits = 0
    if digits == 0 or digits > 18 or mantissa > _EXACT:
        return 0.0, -1
    if buf[i] == 69:  # E
        i += 1
        down = buf[i] == _MINUS
        if down:
            i += 1
        first = i
        exponent = 0
        while _ZERO <= buf[i] <= _NINE and i - first < 4:
            exponent = exponent * 10 + np.int64(buf[i] - _ZERO)
            i += 1
        if i == first:
            return 0.0, -1
        power += -exponent if down else exponent
    if power < -22 or power > 22:
        return 0.0, -1
    value = np.float64(mantissa)
    value = value / _POWERS[-power] if power < 0 else value * _POWERS[power]
    return (-value if negative else value), i


@inline_kernel
def _digits13(buf, i):  # type: ignore[no-untyped-def]
    """Integer of exactly 13 digits at i (the Unix time in ms), -1 for anything else."""
    value = np.int64(0)
    for j in range(13):
        c = buf[i + j]
        if c < _ZERO or c > _NINE:
            value = np.int64(-1)
            break
        value = value * 10 + np.int64(c - _ZERO)
    return value


@inline_kernel
def _nibble(c):  # type: ignore[no-untyped-def]
    """Value of a hexadecimal digit, 255 for anything else."""
    value = np.uint64(255)
    if _ZERO <= c <= _NINE:
        value = np.uint64(c - _ZERO)
    elif 97 <= c <= 102:
        value = np.uint64(c - 87)
    elif 65 <= c <= 70:
        value = np.uint64(c - 55)
    return value


@kernel
def _address(buf, start, stop):  # type: ignore[no-untyped-def]
    """48-bit hardware address in [start, stop) and whether it is one (``hh:hh:hh:hh:hh:hh``)."""
    value = np.uint64(0)
    if stop - start != 17:
        return value, False
    for k in range(6):
        high, low = _nibble(buf[start + 3 * k]), _nibble(buf[start + 3 * k + 1])
        if high > np.uint64(15) or low > np.uint64(15) or (k < 5 and buf[start + 3 * k + 2] != _COLON):
            return value, False
        value = (value << np.uint64(8)) | (high << np.uint64(4)) | low
    return value, True


@kernel
def scan_ms_indoor(buf, line, t, values, ids, token, care, counts):  # type: ignore[no-untyped-def]
    """Scan whole lines; ``buf`` ends with a line end and 64 bytes of zeros behind it.

    line, t : (7, m) out, line number from 1 and s. values : (7, m, 3) out. ids : (7, m) out, 0 where ``token``
    holds the place. token : (m, 4) out, kind, row, start, stop of an identifier that is no address. care : (m, 3)
    out, line, start, stop of lines for the careful path. counts : (13,) out, records per kind, tokens, care lines.
    Returns the number of lines.
    """
    n = buf.size - 64
    tabs = np.zeros(16, np.int64)
    i = 0
    number = 0
    n_token = 0
    n_care = 0
    while i < n:
        start = i
        number += 1
        kind = -1
        ms = np.int64(-1)
        if buf[i] != 35:  # '#'
            ms = _digits13(buf, i)
            if ms > 0 and buf[i + 13] == _TAB and buf[i + 14] == 84 and buf[i + 15] == 89:  # TY
                if buf[i + 16] == 80 and buf[i + 17] == 69 and buf[i + 18] == 95:  # PE_
                    kind = _kind_at(buf, i + 19)
        good = False
        if 0 <= kind < 4:
            row = counts[kind]
            j = i + 19
            while buf[j] != _TAB:
                j += 1
            good = True
            for k in range(3):
                value, j = _decimal(buf, j + 1)
                if j < 0 or buf[j] != _TAB:
                    good = False
                    break
                values[kind, row, k] = value
            if good and _ZERO <= buf[j + 1] <= _NINE and buf[j + 2] == _NEWLINE:  # accuracy 0 ... 3
                i = j + 2
            elif good and buf[j + 1] == _MINUS and _ZERO <= buf[j + 2] <= _NINE and buf[j + 3] == _NEWLINE:
                i = j + 3
            else:
                good = False
                i = start
        if not good:
            n_tabs = 0
            while buf[i] != _NEWLINE:
                if buf[i] == _TAB:
                    if n_tabs < 16:
                        tabs[n_tabs] = i
                    n_tabs += 1
                i += 1
            first, last = 0, 0  # the identifier's place
            if kind >= 7:
                good = n_tabs == (4 if kind == _BLU4 else 8)
            elif kind == _WIFI and n_tabs == 6:
                row = counts[kind]
                rssi, j = _decimal(buf, tabs[3] + 1)
                frequency, k = _decimal(buf, tabs[4] + 1)
                seen = _digits13(buf, tabs[5] + 1)
                good = j == tabs[4] and k == tabs[5] and seen >= 0 and tabs[5] + 14 == i
                values[kind, row, 0], values[kind, row, 1], values[kind, row, 2] = rssi, frequency, seen / 1000.0
                first, last = tabs[2] + 1, tabs[3]
            elif kind == _BLUE and n_tabs == 4:
                row = counts[kind]
                rssi, j = _decimal(buf, tabs[3] + 1)
                good = j == i
                values[kind, row, 0], values[kind, row, 1] = rssi, np.nan
                first, last = tabs[2] + 1, tabs[3]
            elif kind == _BEACON and (n_tabs == 9 or n_tabs == 8):
                row = counts[kind]
                power, j = _decimal(buf, tabs[4] + 1)
                rssi, k = _decimal(buf, tabs[5] + 1)
                good = j == tabs[5] and k == tabs[6]
                values[kind, row, 0], values[kind, row, 1] = rssi, power
                first, last = tabs[7] + 1, tabs[8] if n_tabs == 9 else i
            if good and kind < 7:
                row = counts[kind]
                identifier, plain = _address(buf, first, last)
                ids[kind, row] = identifier
                if last <= first:
                    good = False
                elif not plain:
                    token[n_token, 0], token[n_token, 1] = kind, row
                    token[n_token, 2], token[n_token, 3] = first, last
                    n_token += 1
        if good:
            row = counts[kind]
            if kind < 7:
                line[kind, row] = number
                t[kind, row] = ms / 1000.0
            counts[kind] = row + 1
        elif i > start:
            care[n_care, 0], care[n_care, 1], care[n_care, 2] = number, start, i
            n_care += 1
        i += 1
    counts[11] = n_token
    counts[12] = n_care
    return number


@kernel
def mark_repeats(t, ids, values, table, repeat):  # type: ignore[no-untyped-def]
    """Mark the readings that repeat an earlier one exactly (time, identifier, three values; NaN equals NaN).

    table : (2^k,) int64 of -1, at least twice as long as the readings. repeat : (n,) bool out.
    """
    mask = np.uint64(table.size - 1)
    for i in range(t.size):
        key = ids[i] * np.uint64(0x9E3779B97F4A7C15) + np.uint64(np.int64(t[i] * 1e3)) * np.uint64(0xC2B2AE3D27D4EB4F)
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
