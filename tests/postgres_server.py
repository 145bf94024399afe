"""A PostgreSQL server of the tests' own: binaries of the machine, a free port, a temporary folder."""

from __future__ import annotations

import os
import pwd
import shutil
import signal
import socket
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from programs import skip_without

__all__ = ["create_database", "running_server"]


def _binaries() -> Path | None:
    found = shutil.which("initdb")
    if found:
        return Path(found).resolve().parent
    versions = sorted(Path("/usr/lib/postgresql").glob("*/bin/initdb"))
    return versions[-1].parent if versions else None


def _account() -> pwd.struct_passwd | None:
    """Whom to run it as: PostgreSQL refuses root."""
    if os.getuid() != 0:
        return None
    for name in ("postgres", "nobody"):
        try:
            return pwd.getpwnam(name)
        except KeyError:
            continue
    return skip_without("PostgreSQL", "running as root, and no unprivileged user to start it as")


@contextmanager
def running_server() -> Iterator[str]:
    """URL of the server up to the name of the database; skips loudly where there is no PostgreSQL."""
    binaries = _binaries()
    if binaries is None:
        skip_without("PostgreSQL", "no initdb on this machine")
    account = _account()
    user = {} if account is None else {"user": account.pw_uid, "group": account.pw_gid}
    folder = Path(tempfile.mkdtemp(prefix="wayfuse-postgres-"))
    try:
        if account is not None:
            os.chown(folder, account.pw_uid, account.pw_gid)
        data = folder / "data"
        initdb = [binaries / "initdb", "-D", data, "-U", "wayfuse", "-A", "trust", "-N", "-E", "UTF8"]
        subprocess.run(initdb, check=True, capture_output=True, cwd=folder, **user)
        with socket.socket() as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        options = ["-p", str(port), "-c", "listen_addresses=127.0.0.1", "-c", "fsync=off", "-k", str(folder)]
        server = subprocess.Popen(
            [binaries / "postgres", "-D", data, *options],
            cwd=folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            **user,
        )
        try:
            _wait([binaries / "pg_isready", "-h", "127.0.0.1", "-p", str(port)])
            yield f"postgresql://wayfuse@127.0.0.1:{port}"
        finally:
            server.send_signal(signal.SIGQUIT)  # at once: nothing of it is kept
            server.wait(30)
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _wait(command: list[object]) -> None:
    for _ in range(300):
        if subprocess.run(list(map(str, command)), capture_output=True, check=False).returncode == 0:
            return
        time.sleep(0.1)
    raise RuntimeError("the PostgreSQL server did not start")


def create_database(server: str, name: str, template: str = "template1") -> str:
    """URL of a new database, a copy of another one."""
    from sqlalchemy import create_engine, text

    address = server.replace("postgresql://", "postgresql+pg8000://") + "/postgres"
    engine = create_engine(address, isolation_level="AUTOCOMMIT")
    with engine.connect() as connection:
        connection.execute(text(f'CREATE DATABASE "{name}" TEMPLATE "{template}"'))
    engine.dispose()
    return f"{server}/{name}"
