"""``wayfuse send``: recordings to a server, as phones would send them while they are made."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["send"]

_MOST_AT_ONCE = 64
_TIMEOUT_S = 30.0
_BUSY = (429, 503)
_PATIENCE = 60  # times that a busy server is asked again


class _Sent(NamedTuple):
    """What became of a recording. track : the server's name of it."""

    recording: str
    batches: int
    records: int
    track: str


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("recordings", metavar="RECORDING...", nargs=-1, required=True)
@click.option(
    "--to", "address", default="http://127.0.0.1:8080", show_default=True, help="Address of the server."
)
@click.option(
    "--token",
    envvar="WAYFUSE_TOKEN",
    show_envvar=True,
    required=True,
    help="With the scope ingest, or admin.",
)
@click.option("--site", default="", help="Name of the site, where the server has several.")
@click.option(
    "--every", type=click.FloatRange(0.05, 60.0), default=1.0, show_default=True, help="Seconds of a batch."
)
@click.option(
    "--speed",
    type=click.FloatRange(0.0),
    default=1.0,
    show_default=True,
    help="Times as fast as it was recorded; 0: as fast as the server answers.",
)
@click.option("--json", "as_json", is_flag=True, help="Print what was sent as JSON.")
def send(
    recordings: tuple[str, ...],
    address: str,
    token: str,
    site: str,
    every: float,
    speed: float,
    as_json: bool,
) -> None:
    """Send recordings to a running `wayfuse serve`, each as a phone of its own, at the same time.

    RECORDING is a file, a folder, or @FILE with a path per line. Motion samples, steps, Wi-Fi and Bluetooth scans and
    ranges are sent; waypoints are not, nor is channel state, which is the anchors' to send.
    """
    import json
    from concurrent.futures import ThreadPoolExecutor

    from wayfuse.core.errors import UsageError
    from wayfuse.formats.reading import expand

    if not address.startswith(("http://", "https://")):
        raise UsageError(f"'{address}' is no address", where="--to", remedy="give http://MACHINE:PORT")
    paths = list({path.resolve(): path for path in expand(recordings)}.values())
    sender = _Sender(address.rstrip("/"), token, site, every, speed)
    sent: list[_Sent] = []
    with (
        click.progressbar(length=len(paths), label="sending", file=sys.stderr) as bar,
        ThreadPoolExecutor(min(len(paths), _MOST_AT_ONCE)) as pool,
    ):
        try:
            for one in pool.map(sender, paths):
                sent.append(one)
                bar.update(1)
        finally:
            sender.stop.set()  # where one failed, or the user has had enough
    if as_json:
        click.echo(json.dumps([one._asdict() for one in sent], indent=1, ensure_ascii=False))
        return
    for one in sent:
        click.echo(f"{one.recording}: {one.batches} batches, {one.records} records, track {one.track}")


class _Sender:
    """Sends one recording; several at a time."""

    def __init__(self, address: str, token: str, site: str, every: float, speed: float) -> None:
        from threading import Event
        from urllib.parse import urlencode

        self.stop = Event()
        query = f"?{urlencode({'site': site})}" if site else ""
        self.url, self.token, self.every, self.speed = f"{address}/api/v1/in/own{query}", token, every, speed

    def __call__(self, path: Path) -> _Sent:
        import time

        from wayfuse.formats.reading import read

        recording = read(path)
        began, session = time.monotonic(), f"{recording.name} at {time.time():.0f}"
        batches = records = 0
        track = ""
        for body in _bodies(recording, session, self.every):
            due = began + (batches + 1) * self.every / self.speed if self.speed else began
            if self.stop.wait(max(0.0, due - time.monotonic())):
                break
            batches += 1
            for accepted in self._post(body):
                records += accepted["records"]
                track = accepted["track"]
        return _Sent(recording.name, batches, records, track)

    def _post(self, body: bytes) -> list[dict[str, Any]]:
        import json
        from urllib.error import HTTPError, URLError
        from urllib.request import Request, urlopen

        from wayfuse.core.errors import UsageError

        headers = {"Authorization": f"Bearer {self.token}", "Content-Type": "application/json"}
        for _ in range(_PATIENCE):
            try:
                with urlopen(Request(self.url, body, headers), timeout=_TIMEOUT_S) as answer:  # noqa: S310 (checked)
                    accepted: list[dict[str, Any]] = json.load(answer)["accepted"]
                    return accepted
            except HTTPError as no:
                if no.code in _BUSY:
                    self.stop.wait(_seconds(no.headers.get("Retry-After")))
                    continue
                what, remedy = _told(no)
                raise UsageError(what, where=self.url, remedy=remedy) from no
            except (URLError, OSError) as error:
                why = getattr(error, "reason", error)
                raise UsageError(
                    f"no answer: {why}", where=self.url, remedy="is `wayfuse serve` running?"
                ) from error
        raise UsageError("the server is busy", where=self.url, remedy="send fewer recordings at once")


def _bodies(recording: Any, session: str, every: float) -> Iterator[bytes]:
    from wayfuse.service.replay import envelopes
    from wayfuse.service.wire import encode

    for envelope in envelopes(recording, recording.name, session, every):
        yield encode(envelope)


def _seconds(text: str | None) -> float:
    try:
        return min(60.0, max(0.1, float(text or 1.0)))
    except ValueError:
        return 1.0


def _told(no: Any) -> tuple[str, str]:
    """What a server says is wrong, and what to do."""
    import json

    try:
        said = json.loads(no.read(65_536))
        return f"{no.code}: {said['error']}", str(said.get("remedy") or "")
    except (ValueError, KeyError, TypeError):
        return f"{no.code}: {no.reason}", ""
