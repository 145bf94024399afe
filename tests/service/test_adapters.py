"""What phones send is read as their files are: the same records, from the same reader, to the bit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mutations import body_of, mutated

from wayfuse.core.errors import ConfigError, UsageError
from wayfuse.formats import getsensordata, sensor_logger
from wayfuse.sensors.records import (
    Acceleration,
    CsiFrame,
    Range,
    RotationRate,
    WifiScan,
    bssid_id,
    bssid_text,
)
from wayfuse.service.adapters import ADAPTERS
from wayfuse.service.identity import KEY_BYTES, Pseudonyms, is_random_address, load_key
from wayfuse.service.message import BadBodyError, Profile, SayToUserError
from wayfuse.service.replay import envelopes
from wayfuse.service.routes.examples import EXAMPLES
from wayfuse.service.settings import ENVIRONMENT, Settings, load_settings
from wayfuse.service.wire import encode

T0 = 1_763_801_000_000_000_000  # ns
ANDROID = Profile(platform="android")


def _same(a: Any, b: Any) -> bool:
    if isinstance(a, WifiScan) or isinstance(b, WifiScan):
        names = ("bssid", "rssi", "frequency", "last_seen")
        return a.t == b.t and all(
            np.array_equal(getattr(a, n), getattr(b, n), equal_nan=n == "last_seen") for n in names
        )
    return type(a) is type(b) and a == b


def _push(n: int = 200) -> list[dict[str, Any]]:
    draw = np.random.default_rng(3)
    items: list[dict[str, Any]] = []
    for i in range(n):
        t = T0 + i * 10_000_000
        x, y, z = draw.normal(size=3).round(6).tolist()
        items.append({"name": "accelerometer", "time": t, "values": {"x": x, "y": y, "z": z}})
        items.append({"name": "Gravity", "time": t, "values": {"x": 0.1, "y": 0.2, "z": 9.79}})
        items.append({"name": "gyroscope", "time": t, "values": {"x": y, "y": z, "z": x}})
    for i in range(3):
        ap = {"bssid": f"00:1b:63:00:00:0{i}", "level": -50 - i, "frequency": 2437, "ssid": "a"}
        items.append({"name": "wifi", "time": T0 + 10**9 + i * 10**6, "values": ap})
    return items


def _body(payload: list[dict[str, Any]]) -> bytes:
    return json.dumps({"messageId": 1, "sessionId": "s", "deviceId": "d", "payload": payload}).encode()


@pytest.mark.parametrize("platform", ["android", "ios"])
@pytest.mark.parametrize("standardised", [False, True])
def test_a_push_is_read_as_the_export_of_the_same_samples(
    tmp_path: Path, platform: str, standardised: bool
) -> None:
    payload = _push()
    rows = [{"sensor": "Metadata", "platform": platform, "standardisation": str(standardised)}]
    rows += [
        {"sensor": item["name"], "time": str(item["time"])} | {k: str(v) for k, v in item["values"].items()}
        for item in payload
    ]
    path = tmp_path / "export.json"
    path.write_text(json.dumps(rows), encoding="utf-8")
    expected = list(sensor_logger.read(path).records())
    profile = Profile(platform=platform, standardised=standardised)
    message = ADAPTERS["sensor-logger"].read(_body(payload), profile, 0.0)[0]
    assert len(expected) == 401
    assert all(_same(a, b) for a, b in zip(message.parts[0].records, expected, strict=True))


def test_a_push_without_platform_is_refused_and_broken_items_are_counted() -> None:
    with pytest.raises(SayToUserError, match="Android or an iPhone"):
        ADAPTERS["sensor-logger"].read(_body(_push()), Profile(), 0.0)
    broken = [
        {"name": "gyroscope", "time": T0, "values": {"x": 1}},
        {"name": "gyroscope", "time": T0, "values": None},
        {"name": "wifi", "time": T0, "values": {"bssid": "", "level": -5}},
        {"name": "camera", "time": T0, "values": {"base64": "AAAA"}},
    ]
    message = ADAPTERS["sensor-logger"].read(_body(broken), ANDROID, 0.0)[0]
    assert message.n_records == 0
    assert message.notes == {"gyroscope: values cannot be read": 2, "wifi: values cannot be read": 1}


def test_an_uploaded_log_is_read_as_the_file(world: Any, tmp_path: Path) -> None:
    lines = ["% GetSensorData"]
    for r in world.walks[0].records():
        if isinstance(r, Acceleration):
            lines.append(f"ACCE;{r.t - 1.5e9!r};{r.t!r};{r.x!r};{r.y!r};{r.z!r};3")
        elif isinstance(r, WifiScan):
            for i, level in zip(r.bssid.tolist(), r.rssi.tolist(), strict=True):
                lines.append(f"WIFI;{r.t - 1.5e9!r};{r.t!r};x;{bssid_text(i)};2437;{level}")
    body = ("\n".join(lines) + "\n").encode()
    path = tmp_path / "log.txt"
    path.write_bytes(body)
    expected = list(getsensordata.read(path).records())
    message = ADAPTERS["getsensordata"].read(body, Profile(device="d"), 0.0)[0]
    assert len(expected) > 1000
    assert all(_same(a, b) for a, b in zip(message.parts[0].records, expected, strict=True))
    assert message.is_end


@pytest.mark.parametrize(
    ("body", "profile"), [(b"", Profile("d")), (b"x\n", Profile("d")), (b"% GetSensorData\n", Profile())]
)
def test_uploads_that_are_none(body: bytes, profile: Profile) -> None:
    with pytest.raises(BadBodyError):
        ADAPTERS["getsensordata"].read(body, profile, 0.0)


def test_own_envelopes_bring_back_the_recording(world: Any) -> None:
    walk = world.walks[0]
    expected = [r for r in walk.records() if type(r).__name__ != "Waypoint"]
    got = [
        r
        for e in envelopes(walk, "d", "t", 3.3)
        for r in ADAPTERS["own"].read(encode(e), Profile(), 0.0)[0].parts[0].records
    ]
    assert all(_same(a, b) for a, b in zip(got, expected, strict=True))
    with pytest.raises(ConfigError):
        next(envelopes(walk, "d", every=0.0))


def test_a_scan_without_time_is_stamped_with_its_arrival() -> None:
    body = json.dumps({"d": "x", "f": "home", "s": {"wifi": {"00:1b:63:00:00:01": -40}}}).encode()
    message = ADAPTERS["find3"].read(body, Profile(), 123.5)[0]
    scan = message.parts[0].records[0]
    assert isinstance(scan, WifiScan)
    assert scan.t == 123.5
    assert message.session == "home"
    with pytest.raises(BadBodyError, match="learning"):
        ADAPTERS["find3"].read(body[:-1] + b', "l": "kitchen"}', Profile(), 0.0)


def test_whom_a_passive_scanner_heard_is_one_message_each_and_the_scanner_is_the_anchor() -> None:
    fixed, other, drawn = "00:1b:63:00:00:01", "00:1b:63:00:00:02", "da:a1:19:00:00:01"
    levels = {"wifi": {fixed: -40, drawn: -50, other: "loud"}, "bluetooth": {fixed: -70}, "smell": {fixed: 1}}
    body = json.dumps({"d": "scanner-1", "f": "home", "t": 1763801000500, "s": levels}).encode()
    first, second = ADAPTERS["find3-passive"].read(body, Profile(), 0.0)
    assert (first.device, first.session, second.device) == (fixed, "home", other)
    scan, heard = sorted(first.parts[0].records, key=lambda r: type(r).__name__, reverse=True)
    assert isinstance(scan, WifiScan)
    assert (scan.t, scan.bssid.tolist(), scan.rssi.tolist()) == (
        1763801000.5,
        [bssid_id("scanner-1")],
        [-40.0],
    )
    assert (heard.id, heard.rssi) == (bssid_id("scanner-1"), -70.0)
    assert first.notes == {"device with a random address": 1}
    assert second.notes == {"wifi: not a level where one is due": 1}
    assert drawn not in (first.body + second.body).decode()
    assert other not in first.body.decode()
    (again,) = ADAPTERS["find3-passive"].read(first.body, Profile(), 0.0)  # as the log is read
    assert again.parts[0].key == first.parts[0].key
    assert again.body == first.body
    assert ADAPTERS["find3-passive"].read(b'{"d": "s", "s": {"wifi": {}}}', Profile(), 0.0) == []


def test_an_anchor_s_frame_has_range_channel_and_the_target_s_motion() -> None:
    frame = {
        "target": "tag",
        "rssi": -61.5,
        "seq": 7,
        "range_m": 8.25,
        "csi": {"iq": [[[1, 2], [3, 4]], [[5, 6], [7, 8]]], "agc": 30, "noise": -90},
        "imu": [[1.5e9, 0.1, 0.2, 9.8, 0.01, 0.02, 0.03]],
    }
    body = json.dumps({"v": 1, "anchor": "an-1", "t": 2 * 10**9, "frames": [frame]}).encode()
    radio, motion = ADAPTERS["anchors"].read(body, Profile(), 0.0)[0].parts
    scan, distance, csi = radio.records
    assert isinstance(scan, WifiScan)
    assert scan.bssid.tolist() == [bssid_id("an-1")]
    assert isinstance(distance, Range)
    assert distance[:3] == (2.0, bssid_id("an-1"), 8.25)
    assert isinstance(csi, CsiFrame)
    assert csi.csi.shape == (2, 1, 2)
    assert csi.csi[1, 0].tolist() == [5 + 6j, 7 + 8j]
    assert motion.records == (Acceleration(1.5, 0.1, 0.2, 9.8), RotationRate(1.5, 0.01, 0.02, 0.03))
    other = body.replace(b"an-1", b"an-2")
    assert ADAPTERS["anchors"].read(other, Profile(), 0.0)[0].parts[1].key == motion.key  # counts once


@pytest.mark.parametrize("adapter", EXAMPLES)
def test_what_goes_to_the_log_is_read_back_as_it_was(adapter: str) -> None:
    example = EXAMPLES[adapter]
    if adapter == "anchors":
        frames = [*example["frames"], {"target": "other", "rssi": -50.0}, {"target": "tag-3", "rssi": -1 / 3}]
        example = example | {"frames": frames}
    body = example.encode() if isinstance(example, str) else json.dumps(example).encode()
    profile = Profile("d", "", "android")
    for message in ADAPTERS[adapter].read(body, profile, 5.0):
        again = ADAPTERS[adapter].read(message.body, profile, 5.0)
        assert len(again) == 1
        assert [p.key for p in again[0].parts] == [p.key for p in message.parts]
        for one, two in zip(again[0].parts, message.parts, strict=True):
            assert all(_same(a, b) for a, b in zip(one.records, two.records, strict=True))


# --- fuzz -------------------------------------------------------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=6), inner, max_size=4),
    max_leaves=12,
)


def _read(adapter: str, body: bytes) -> None:
    """Reads or refuses; nothing else."""
    try:
        messages = ADAPTERS[adapter].read(body, Profile("d", "", "android"), 1e9)
    except BadBodyError:
        return
    for message in messages:
        times = [r.t for part in message.parts for r in part.records]
        assert all(np.isfinite(times))
        assert all(n > 0 for n in message.notes.values())


@pytest.mark.parametrize("adapter", EXAMPLES)
def test_mutated_bodies_are_read_or_refused(adapter: str) -> None:
    body = body_of(adapter)
    draw = np.random.default_rng(11)
    for _ in range(600):
        _read(adapter, mutated(body, draw))


@given(st.sampled_from(sorted(EXAMPLES)), st.binary(max_size=300))
def test_random_bytes_are_read_or_refused(adapter: str, body: bytes) -> None:
    _read(adapter, body)


@given(st.sampled_from(sorted(set(EXAMPLES) - {"getsensordata"})), st.data())
def test_bodies_with_any_value_in_any_place_are_read_or_refused(adapter: str, data: st.DataObject) -> None:
    body = json.loads(json.dumps(EXAMPLES[adapter]))
    place: Any = body
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        inner = place[key]
        if not isinstance(inner, dict | list) or not inner or data.draw(st.booleans()):
            place[key] = data.draw(JSON)
            break
        place = inner
    _read(adapter, json.dumps(body).encode("utf-8", "surrogatepass"))


# --- names ------------------------------------------------------------------------------------------------


def test_pseudonyms_depend_on_the_key_and_on_every_part() -> None:
    one, two = Pseudonyms(bytes(KEY_BYTES)), Pseudonyms(bytes([1]) * KEY_BYTES)
    names = {
        one.device("a"),
        one.device("b"),
        two.device("a"),
        one.track("s", "a", ""),
        one.track("", "s", "a"),
        one.track("sa", "", ""),
    }
    assert len(names) == 6
    assert one.device("a") == Pseudonyms(bytes(KEY_BYTES)).device("a")
    assert len(one.device("\ud800")) == 16


def test_the_key_is_made_once_and_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / "site.key"
    key = load_key(path, lambda n: bytes(range(n)))
    assert load_key(path, bytes) == key == bytes(range(KEY_BYTES))
    assert path.stat().st_mode & 0o077 == 0
    path.write_text("short", encoding="ascii")
    with pytest.raises(UsageError, match="not the key"):
        load_key(path, bytes)


@pytest.mark.parametrize(
    ("name", "is_random"),
    [("02:00:00:00:00:00", True), ("00:00:00:00:00:00", False), ("0a0000000000", True), ("phone", False)],
)
def test_random_addresses_are_known(name: str, is_random: bool) -> None:
    assert is_random_address(name) == is_random


# --- settings ---------------------------------------------------------------------------------------------


def test_settings_come_in_order(tmp_path: Path) -> None:
    path = tmp_path / "server.toml"
    path.write_text('port = 1\nhost = "a"\nrewind_s = 5\n', encoding="utf-8")
    environment = {f"{ENVIRONMENT}PORT": "2", f"{ENVIRONMENT}IDLE_S": "60", "OTHER": "x"}
    found = load_settings(path, environment, {"port": 3, "host": None})
    assert found == Settings(port=3, host="a", rewind_s=5.0, idle_s=60.0)
    assert load_settings(None, {}) == Settings()


@pytest.mark.parametrize(
    ("text", "environment"),
    [
        ("prot = 1", {}),
        ("port = true", {}),
        ('port = "1"', {}),
        ("port = ", {}),
        ("port = 70000", {}),
        ("particles = 0", {}),
        ("rewind_s = -1", {}),
        ('tls_key = "a"', {}),
        ("", {f"{ENVIRONMENT}PORT": "many"}),
        ("", {f"{ENVIRONMENT}NONSENSE": "1"}),
    ],
)
def test_settings_that_are_wrong_are_named(tmp_path: Path, text: str, environment: dict[str, str]) -> None:
    path = tmp_path / "server.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as told:
        load_settings(path, environment)
    assert told.value.where


def test_a_settings_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="cannot be read"):
        load_settings(tmp_path / "none.toml", {})
