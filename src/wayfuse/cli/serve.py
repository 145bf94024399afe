"""``wayfuse serve``: phones and anchors in, positions out, in one process."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["serve"]


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("site_folders", metavar="[SITE]...", nargs=-1, type=click.Path(path_type=Path))
@click.option(
    "--radio-map",
    "radio_maps",
    multiple=True,
    type=click.Path(path_type=Path),
    help="From `wayfuse survey build`; published at once. One per site; without, upload one later.",
)
@click.option("--config", type=click.Path(path_type=Path), help="TOML file of settings (docs/server.md).")
@click.option("--host", help="Address to listen on; 0.0.0.0 for all.  [default: 127.0.0.1]")
@click.option("--port", type=click.IntRange(0, 65535), help="0: any free one.  [default: 8080]")
@click.option("--data", help="Folder of the database and the key of the pseudonyms.  [default: wayfuse-data]")
@click.option("--database", help="URL of a PostgreSQL database, instead of SQLite in the data folder.")
@click.option(
    "--mqtt", help="URL of a broker to listen to and to tell positions, mqtt://HOST:PORT or mqtts://."
)
@click.option("--geofences", help="GeoJSON file of areas to watch besides the rooms of the plans.")
@click.option("--tls-certificate", help="PEM file; with the key, the server speaks HTTPS.")
@click.option("--tls-key", help="PEM file.")
@click.option(
    "--new-admin-token", is_flag=True, help="Make another administrator's token: the first is lost."
)
def serve(
    site_folders: tuple[Path, ...],
    radio_maps: tuple[Path, ...],
    config: Path | None,
    new_admin_token: bool,
    **given: str | int | None,
) -> None:
    """Serve live positions in SITE... over HTTP; without a SITE, in those that were imported over the page.

    Phones post their records, tracks come out as GeoJSON, as a stream of events, and on the page at `/`. At the first
    start an administrator's token is printed, once; it makes the tokens of phones and readers.

    Anchors that measure ranges are known by files in the site's folder: access_points.csv says where they hang,
    channel.npz makes ranges of channel state (docs/server.md).

    Settings come from the options, the environment (`WAYFUSE_SERVER_PORT=8443`), the file of --config, in this order.
    """
    import os
    import secrets
    import time

    from wayfuse.core.errors import UsageError

    try:
        from wayfuse.service.run import serve as run
        from wayfuse.service.server import Server, match_radio_maps
    except ModuleNotFoundError as error:
        raise UsageError(
            f"the server needs the package {error.name}", remedy="pip install 'wayfuse[server]'"
        ) from error
    from wayfuse.service.settings import load_settings

    settings = load_settings(config, os.environ, given)
    sites = match_radio_maps(site_folders, radio_maps)
    server = Server(settings, sites, clock=time.time, random=secrets.token_bytes)
    token = server.first_admin_token(anew=new_admin_token)
    if token is not None:
        click.echo(f"administrator's token, shown this once: {token}")
    for name in server.worlds:
        if server.in_use(name) is None:
            note = f"note: site {name} has no radio map yet; its phones are refused until one is published"
            click.echo(note, err=True)
        elif server.published(name) is None:
            click.echo(
                f"note: site {name} has no radio map: phones are tracked by ranges to its anchors", err=True
            )
    run(
        server,
        lambda address: click.echo(f"serving {', '.join(server.worlds) or 'no site yet'} at {address}"),
    )
