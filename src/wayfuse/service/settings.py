"""Settings of a server: defaults, then a TOML file, then the environment, then the command line."""

from __future__ import annotations

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from wayfuse.core.errors import ConfigError

__all__ = ["ENVIRONMENT", "Settings", "load_settings"]

ENVIRONMENT = "WAYFUSE_SERVER_"  # WAYFUSE_SERVER_PORT=8443 sets port


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All settings; the comment of each is its documentation in docs/server.md."""

    host: str = "127.0.0.1"  # address to listen on; 0.0.0.0 for all
    port: int = 8080  # 0: any free one
    data: str = "wayfuse-data"  # folder of the database and the key of the pseudonyms
    database: str = ""  # URL; empty: SQLite in the data folder
    method: str = "fused"  # of `wayfuse track --method`, one that needs a radio map alone
    particles: int = 1000  # per track
    seed: int = 0  # equal seeds give equal bits
    rewind_s: float = 10.0  # how late a record may come and still count
    spacing_s: float = 3.0  # between the states kept for that
    max_body_bytes: int = 1_048_576  # of one request
    max_upload_bytes: int = 16_777_216  # of an uploaded log or radio map
    max_waiting: int = 10_000  # batches that may wait to be written; more are answered 503
    rate_per_s: float = 100.0  # requests per token; more are answered 429; 0: no limit
    rate_burst: int = 500  # requests per token at once
    checkpoint_s: float = 10.0  # between checkpoints; what came since is read again after a crash
    idle_s: float = 900.0  # until a silent track leaves the memory (it stays in the database)
    retain_log_h: float = 24.0  # raw batches are deleted after
    retain_tracks_d: float = 30.0  # tracks are deleted after
    retain_survey_d: float = (
        365.0  # scans, walks and recordings of surveys are deleted after; radio maps stay
    )
    retain_audit_d: float = 365.0  # what was done by whom is forgotten after
    csi_port: int = 0  # for streams of channel state from Intel 5300 cards; 0: none
    geofences: str = ""  # GeoJSON file of areas to watch besides the rooms of the plan
    mqtt: str = ""  # URL of a broker, mqtt://USER:PASSWORD@HOST:PORT or mqtts://; empty: none
    mqtt_prefix: str = "wayfuse"  # first level of the topics
    mqtt_discovery: str = (
        "homeassistant"  # where Home Assistant looks for new devices; empty: tell it nothing
    )
    events: int = 10_000  # kept for clients that resume a stream of events
    tls_certificate: str = ""  # PEM file; with the key, the server speaks HTTPS
    tls_key: str = ""  # PEM file

    def __post_init__(self) -> None:
        positive = ("particles", "max_body_bytes", "max_upload_bytes", "max_waiting", "rate_burst", "events")
        retained = [name for name in _FIELDS if name.startswith("retain_")]
        for name in (*positive, *retained, "checkpoint_s", "spacing_s", "idle_s"):
            if not getattr(self, name) > 0:
                raise ConfigError(f"{name} must be positive, got {getattr(self, name)}", where=name)
        for name in ("rewind_s", "rate_per_s"):
            if not getattr(self, name) >= 0.0:
                raise ConfigError(f"{name} must not be negative, got {getattr(self, name)}", where=name)
        for name in ("port", "csi_port"):
            if not 0 <= getattr(self, name) <= 65_535:
                raise ConfigError(f"{name} must be 0 to 65535, got {getattr(self, name)}", where=name)
        if not self.mqtt_prefix or set("#+") & set(self.mqtt_prefix + self.mqtt_discovery):
            raise ConfigError("mqtt_prefix must be a topic without wildcards", where="mqtt_prefix")
        if bool(self.tls_certificate) != bool(self.tls_key):
            raise ConfigError("tls_certificate and tls_key go together", where="tls_key")

    @property
    def database_url(self) -> str:
        """The database, SQLite in the data folder where none is named."""
        return self.database or f"sqlite:///{Path(self.data).resolve() / 'wayfuse.db'}"


_FIELDS = {field.name: field for field in dataclasses.fields(Settings)}


def load_settings(
    path: Path | None, environment: Mapping[str, str], given: Mapping[str, Any] | None = None
) -> Settings:
    """Settings of a TOML file, the environment and what was given (None: not given), the later over the earlier.

    Raises
    ------
    ConfigError : an unknown name, a value of the wrong type, or a file that cannot be read.
    """
    values: dict[str, Any] = {}
    if path is not None:
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise ConfigError(f"cannot be read: {error}", where=path, remedy="see docs/server.md") from error
        values |= {name: _typed(name, value, str(path)) for name, value in table.items()}
    for key, text in environment.items():
        if key.startswith(ENVIRONMENT):
            name = key.removeprefix(ENVIRONMENT).lower()
            values[name] = _parsed(name, text, key)
    values |= {name: value for name, value in (given or {}).items() if value is not None}
    return Settings(**values)


def _typed(name: str, value: Any, where: str) -> Any:
    kind = _kind(name, where)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise ConfigError(
            f"{name} must be {kind.__name__}, got {value!r}", where=where, remedy="see docs/server.md"
        )
    return value


def _parsed(name: str, text: str, where: str) -> Any:
    kind = _kind(name, where)
    try:
        return kind(text)
    except ValueError as error:
        raise ConfigError(f"{name} must be {kind.__name__}, got {text!r}", where=where) from error


def _kind(name: str, where: str) -> type:
    if name not in _FIELDS:
        raise ConfigError(f"no setting {name}", where=where, remedy="see docs/server.md")
    return type(_FIELDS[name].default)
