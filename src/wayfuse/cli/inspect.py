"""``wayfuse inspect``: what recordings hold, and what was wrong with them."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from wayfuse.sensors.recording import Recording, Series

__all__ = ["inspect"]


@click.command()
@click.argument("recordings", nargs=-1, required=True, metavar="RECORDING...")
@click.option(
    "--format", "format_", help="Format of the recordings, where it cannot be told from the content."
)
@click.option("--platform", help="android or ios, for Sensor Logger files that do not say it.")
@click.option("--json", "as_json", is_flag=True, help="Write a JSON array for machines.")
@click.pass_context
def inspect(
    context: click.Context,
    recordings: tuple[str, ...],
    format_: str | None,
    platform: str | None,
    as_json: bool,
) -> None:
    """Say what each RECORDING holds: records and rates per kind, waypoints, and every fault with its lines.

    A RECORDING is a file, a folder (all recordings below it) or @FILE with a path per line. A file that
    cannot be read is reported and the others are read; the exit status is then 1.
    """
    from wayfuse.core.errors import WayfuseError
    from wayfuse.formats import reading

    answers: list[dict[str, Any]] = []
    failed = False
    for path in reading.expand(recordings):
        try:
            kind = format_ or reading.sniff(path)
            answer = summary(reading.read(path, format=kind, platform=platform), kind)
        except WayfuseError as error:
            failed = True
            answer = {"path": str(path), "error": str(error)}
        answers.append(answer)
        if not as_json:
            _print(answer)
    if as_json:
        click.echo(json.dumps(answers, indent=2, ensure_ascii=False))
    if failed:
        context.exit(1)


def summary(recording: Recording, kind: str) -> dict[str, Any]:
    """What a recording holds as plain values (times in s, rates in Hz)."""
    start, stop = recording.span
    records = {
        "acceleration": _series(recording.acceleration),
        "rotation_rate": _series(recording.rotation_rate),
        "magnetic_field": _series(recording.magnetic_field),
        "pressure": _series(recording.pressure),
        "orientation": _series(recording.orientation),
        "wifi_scans": _events([s.t for s in recording.wifi]),
        "ble": _events([b.t for b in recording.ble]),
        "ranges": _events([r.t for r in recording.ranges]),
        "csi": _events([c.t for c in recording.csi]),
    }
    readings = sum(len(s.bssid) for s in recording.wifi)
    return {
        "path": recording.path,
        "name": recording.name,
        "format": kind,
        "device": " ".join(
            p for p in (recording.device.brand, recording.device.model, recording.device.system) if p
        ),
        "site": recording.site,
        "floor": recording.floor,
        "clock": recording.clock,
        "start": start,
        "duration": stop - start,
        "records": records,
        "wifi_readings": readings,
        "access_points": len({int(b) for s in recording.wifi for b in s.bssid}),
        "anchors": len({r.anchor for r in recording.ranges} | {c.anchor for c in recording.csi}),
        "waypoints": [
            {"t": w.t, **{k: v for k, v in w._asdict().items() if k != "t" and v == v and v != ""}}  # noqa: PLR0124
            for w in recording.waypoints
        ],
        "lines": recording.report.n_lines,
        "kinds_in_file": recording.report.n_records,
        "issues": {
            what: {"count": issue.count, "lines": issue.lines}
            for what, issue in sorted(recording.report.issues.items())
        },
    }


def _series(series: Series) -> dict[str, float]:
    return _events(series.t.tolist())


def _events(times: list[float]) -> dict[str, float]:
    """Count, mean rate (Hz) and longest gap (s) of times in order."""
    n = len(times)
    if n < 2 or times[-1] <= times[0]:
        return {"count": n, "rate": 0.0, "longest_gap": 0.0}
    gap = max(b - a for a, b in pairwise(times))
    return {"count": n, "rate": (n - 1) / (times[-1] - times[0]), "longest_gap": gap}


def _print(answer: dict[str, Any]) -> None:
    if "error" in answer:
        click.echo(f"{answer['error']}\n", err=True)
        return
    place = " ".join(p for p in (answer["site"], answer["floor"]) if p)
    click.echo(f"{answer['path']}")
    click.echo(f"  format      {answer['format']}, {answer['lines']} lines, clock: {answer['clock']}")
    click.echo(f"  device      {answer['device'] or 'not recorded'}{', ' + place if place else ''}")
    click.echo(f"  span        {answer['start']:.3f} s, {answer['duration']:.1f} s long")
    for kind, r in answer["records"].items():
        if r["count"]:
            click.echo(
                f"  {kind:15s} {r['count']:7.0f}  {r['rate']:7.2f} Hz, longest gap {r['longest_gap']:.2f} s"
            )
    missing = [kind for kind, r in answer["records"].items() if not r["count"]]
    if missing:
        click.echo(f"  none of     {', '.join(missing)}")
    if answer["wifi_readings"]:
        click.echo(
            f"  Wi-Fi       {answer['wifi_readings']} readings of {answer['access_points']} access points"
        )
    if answer["anchors"]:
        click.echo(f"  anchors     {answer['anchors']}")
    click.echo(f"  waypoints   {len(answer['waypoints'])}")
    for what, issue in answer["issues"].items():
        more = ", ..." if issue["count"] > len(issue["lines"]) else ""
        click.echo(f"  {issue['count']} x {what} (line {', '.join(map(str, issue['lines']))}{more})")
    click.echo("")
