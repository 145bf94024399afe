"""The process: a socket, uvicorn, and the application."""

from __future__ import annotations

import gc
import logging
import socket
from collections.abc import Callable

import uvicorn

from wayfuse.core.errors import UsageError
from wayfuse.service.app import create_app
from wayfuse.service.server import Server

__all__ = ["serve"]

_BACKLOG = 2048
_GRACE_S = 5  # for requests under way, when the server is told to stop
# allocations between looks for cycles; with the interpreter's own (700, 10, 10), which suit small programs, requests
# wait for looks through thousands of tracks, in which there are none
_COLLECT_AFTER = (20_000, 20, 20)


def serve(server: Server, ready: Callable[[str], None]) -> None:
    """Serve until a signal; ``ready`` is called with the address as soon as it takes connections.

    Raises
    ------
    UsageError : the address cannot be listened on, or the TLS files cannot be read.
    """
    settings = server.settings
    listener = _listen(settings.host, settings.port)
    is_tls = bool(settings.tls_certificate)
    logging.basicConfig(level=logging.WARNING, format="%(asctime)s %(levelname)s %(name)s %(message)s")
    config = uvicorn.Config(
        create_app(server),
        log_config=None,
        access_log=False,  # addresses hold tokens, and say who asked for whom
        server_header=False,
        proxy_headers=False,
        loop="uvloop",
        http="httptools",
        ws="websockets-sansio",
        ws_max_size=settings.max_body_bytes,
        timeout_graceful_shutdown=_GRACE_S,
        ssl_certfile=settings.tls_certificate or None,
        ssl_keyfile=settings.tls_key or None,
    )
    try:
        config.load()
    except OSError as error:
        raise UsageError(f"the TLS files cannot be used: {error}", where="tls_certificate") from error
    gc.collect()
    gc.freeze()  # sites, radio maps and code stay: they are looked through no more
    gc.set_threshold(*_COLLECT_AFTER)
    host, port = listener.getsockname()[:2]
    shown = f"[{host}]" if ":" in host else host
    ready(f"{'https' if is_tls else 'http'}://{shown}:{port}")
    _EndingStreams(config, server).run(sockets=[listener])


class _EndingStreams(uvicorn.Server):
    """uvicorn, which waits for open connections when it stops: streams of events would never end by themselves."""

    def __init__(self, config: uvicorn.Config, server: Server) -> None:
        super().__init__(config)
        self._server = server

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End the streams, then stop."""
        self._server.hub.close()
        await super().shutdown(sockets)


def _listen(host: str, port: int) -> socket.socket:
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = socket.socket(family, socket.SOCK_STREAM)
        try:
            listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            listener.bind((host, port))
            listener.listen(_BACKLOG)
        except OSError:
            listener.close()
            raise
    except OSError as error:
        raise UsageError(
            f"cannot listen on {host}:{port}: {error.strerror or error}",
            where="--port",
            remedy="give another --port or --host",
        ) from error
    return listener
