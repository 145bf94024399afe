"""Wayfuse logs: everything written is read back; a damaged line costs itself."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfuse.core.errors import FormatError
from wayfuse.formats import reading
from wayfuse.formats.wayfuse_log import read
from wayfuse.sensors.recording import Device, Recording, Series
from wayfuse.sensors.records import BleReading, CsiFrame, Range, Step, Waypoint, WifiScan
from wayfuse.simulator.wayfuse_log import write_wayfuse_log

NUMBER = st.floats(width=64)
TIME = st.floats(-1e12, 1e12)
IDENTIFIER = st.integers(0, (1 << 64) - 1)
TEXT = st.text(st.characters(blacklist_categories=("Cs",)), max_size=12)


def small(width: int = 32):
    return st.floats(width=width)


@st.composite
def series(draw, k: int) -> Series:
    t = sorted(draw(st.lists(TIME, max_size=4)))
    values = draw(st.lists(st.lists(NUMBER, min_size=k, max_size=k), min_size=len(t), max_size=len(t)))
    return Series(np.array(t, dtype=float), np.array(values, dtype=float).reshape(len(t), k))


@st.composite
def scans(draw) -> WifiScan:
    n = draw(st.integers(0, 3))

    def column(values: st.SearchStrategy, dtype: object) -> np.ndarray:
        return np.array(draw(st.lists(values, min_size=n, max_size=n)), dtype=dtype)

    frequency = column(st.integers(-(2**31), 2**31 - 1), np.int32)
    return WifiScan(
        draw(TIME),
        column(IDENTIFIER, np.uint64),
        column(small(), np.float32),
        frequency,
        column(NUMBER, float),
    )


@st.composite
def frames(draw) -> CsiFrame:
    shape = draw(st.tuples(st.integers(0, 3), st.integers(1, 2), st.integers(1, 3)))
    parts = draw(st.lists(small(), min_size=2 * math.prod(shape), max_size=2 * math.prod(shape)))
    csi = np.array(parts, dtype=np.float32).view(np.complex64).reshape(shape)
    return CsiFrame(draw(TIME), draw(IDENTIFIER), csi, draw(NUMBER), draw(NUMBER), draw(NUMBER))


def ordered(one: st.SearchStrategy) -> st.SearchStrategy:
    return st.lists(one, max_size=3).map(lambda many: tuple(sorted(many, key=lambda r: r.t)))


RECORDINGS = st.builds(
    Recording,
    name=TEXT.filter(bool),
    acceleration=series(3),
    rotation_rate=series(3),
    magnetic_field=series(3),
    pressure=series(1),
    orientation=series(4),
    wifi=ordered(scans()),
    ble=ordered(st.builds(BleReading, TIME, IDENTIFIER, NUMBER, NUMBER)),
    ranges=ordered(st.builds(Range, TIME, IDENTIFIER, NUMBER, NUMBER, NUMBER)),
    steps=ordered(st.builds(Step, TIME, NUMBER, NUMBER)),
    csi=ordered(frames()),
    waypoints=ordered(st.builds(Waypoint, TIME, NUMBER, NUMBER, TEXT, NUMBER, NUMBER)),
    site=TEXT,
    floor=TEXT,
    clock=TEXT,
    device=st.builds(Device, TEXT, TEXT, TEXT),
)
COLUMNS = ("acceleration", "rotation_rate", "magnetic_field", "pressure", "orientation")


def same(a: object, b: object) -> bool:
    """Equal to the bit, NaN and signs of zero included, whatever kind of NaN."""
    if isinstance(a, np.ndarray):
        assert isinstance(b, np.ndarray)
        return (
            a.dtype == b.dtype
            and a.shape == b.shape
            and np.array_equal(
                a.view(np.float32) if a.dtype == np.complex64 else a,
                b.view(np.float32) if b.dtype == np.complex64 else b,
                equal_nan=a.dtype.kind in "fc",
            )
        )
    if isinstance(a, float):
        return isinstance(b, float) and (
            (a == b and math.copysign(1, a) == math.copysign(1, b)) or (math.isnan(a) and math.isnan(b))
        )
    return type(a) is type(b) and a == b


@settings(max_examples=60)
@given(RECORDINGS)
def test_every_record_comes_back_as_it_was(tmp_path_factory, recording):
    path = tmp_path_factory.mktemp("log") / "a.jsonl"
    write_wayfuse_log(path, recording)
    back = read(path)
    assert not {k for k in back.report.issues if k != "no record in the recording"}
    for name in COLUMNS:
        assert same(getattr(back, name).t, getattr(recording, name).t)
        assert same(getattr(back, name).values, getattr(recording, name).values)
    for name in ("wifi", "ble", "ranges", "csi", "waypoints"):
        one, other = getattr(back, name), getattr(recording, name)
        assert len(one) == len(other)
        for a, b in zip(one, other, strict=True):
            fields = a._fields if hasattr(a, "_fields") else a.__slots__
            assert all(same(getattr(a, f), getattr(b, f)) for f in fields), (a, b)
    for name in ("name", "site", "floor", "clock", "device"):
        assert getattr(back, name) == getattr(recording, name)


def log(tmp_path, *lines: str):
    path = tmp_path / "log.jsonl"
    path.write_text("\n".join(['{"wayfuse-log": 1, "name": "n"}', *lines]) + "\n", encoding="utf-8")
    return read(path)


def test_a_log_reads_as_its_page_says(tmp_path):
    got = log(
        tmp_path,
        '["acceleration", 0.1, 0.02, 0.31, 9.79]',
        '["wifi", 1.25, [["0a:74:9c:2e:af:f7", -61.0, 2437, 0.71], ["#00000000000000ff", -70, 0, null]]]',
        '["range", 1.5, 9223372036854775807, 3.2, 0.5, null]',
        '["waypoint", 2, 1.0, "inf", "F1", null, null]',
    )
    assert got.acceleration.values.tolist() == [[0.02, 0.31, 9.79]]
    assert got.wifi[0].bssid.tolist() == [0x0A749C2EAFF7, (1 << 63) | 0xFF]
    assert got.wifi[0].frequency.tolist() == [2437, 0]
    assert math.isnan(got.wifi[0].last_seen[1])
    assert got.ranges[0].anchor == 9223372036854775807
    assert got.waypoints[0].y == math.inf
    assert got.report.n_bad == 0
    assert got.report.n_records == {"acceleration": 1, "wifi": 1, "range": 1, "waypoint": 1}


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        ("", ""),
        ("nonsense", "not a record"),
        ('["acceleration", 0.1, 0.02', "not a record"),
        ('["acceleration", 0.1, 0.02, 0.31]', "not a record"),
        ('["acceleration", null, 0.02, 0.31, 1.0]', "not a record"),
        ('["acceleration", true, 0.02, 0.31, 1.0]', "not a record"),
        ('["acceleration", 0.1, "x", 0.31, 1.0]', "not a record"),
        ('["smell", 0.1, 3]', "a record of an unknown kind"),
        ("[]", "not a record"),
        ("[[1], 2]", "not a record"),
        ("{}", "not a record"),
        ("3", "not a record"),
        ('["wifi", 0.1, [["0a:74:9c:2e:af:f7", -61.0, 2437]]]', "not a record"),
        ('["wifi", 0.1, [[-4, -61.0, 2437, 0.1]]]', "not a record"),
        ('["wifi", 0.1, [[4, -61.0, 99999999999, 0.1]]]', "not a record"),
        ('["csi", 0.1, 1, -60, 30, -92, [1, 1, 2], [1.0, 2.0]]', "not a record"),
        ('["csi", 0.1, 1, -60, 30, -92, [1, 1], [1.0, 2.0]]', "not a record"),
        ('["waypoint", 0.1, 1, 2, 3, null, null]', "not a record"),
        ('["range", 0.1, 1, 2, 3]', "not a record"),
    ],
)
def test_a_damaged_line_costs_itself(tmp_path, line, kind):
    good = '["pressure", 1.0, 1000.0]'
    got = log(tmp_path, good, line, good.replace("1.0", "2.0"))
    assert got.pressure.t.tolist() == [1.0, 2.0]
    assert list(got.report.issues) == ([kind] if kind else [])
    assert not kind or got.report.issues[kind].lines == [3]


def test_records_out_of_order_are_sorted_and_counted(tmp_path):
    got = log(
        tmp_path,
        '["pressure", 2.0, 1001.0]',
        '["pressure", 1.0, 1000.0]',
        '["range", 5.0, 1, 2.0, null, null]',
        '["range", 4.0, 1, 2.0, null, null]',
    )
    assert got.pressure.values.ravel().tolist() == [1000.0, 1001.0]
    assert [r.t for r in got.ranges] == [4.0, 5.0]
    assert got.report.n_bad == 2


@pytest.mark.parametrize(
    "head", ["", "x", "[]", '{"wayfuse-log": "a"}', '{"name": "n"}', '{"wayfuse-log": 2}']
)
def test_another_first_line_is_an_error(tmp_path, head):
    path = tmp_path / "a.jsonl"
    path.write_text(head + '\n["pressure", 1.0, 1000.0]\n')
    with pytest.raises(FormatError, match=r"a\.jsonl"):
        read(path)


def test_a_log_is_known_by_its_first_line(tmp_path):
    path = tmp_path / "a.jsonl"
    write_wayfuse_log(path, Recording("a", pressure=Series(np.array([1.0]), np.array([[1000.0]]))))
    assert reading.sniff(path) == "wayfuse"
    assert reading.read(path).pressure.values.tolist() == [[1000.0]]


def test_a_log_without_records_is_read_and_says_so(tmp_path):
    assert log(tmp_path).report.describe()
