"""Every test of the storage runs on SQLite and on PostgreSQL."""

from __future__ import annotations

import shutil
import uuid
from collections.abc import Iterator
from pathlib import Path

import pytest
from sqlalchemy import Engine

from postgres_server import create_database, running_server
from wayfuse.storage.database import open_database


@pytest.fixture(scope="session")
def postgres() -> Iterator[str]:
    """URL of a running PostgreSQL server, with a migrated database ``template``."""
    with running_server() as url:
        open_database(create_database(url, "template")).dispose()
        yield url


@pytest.fixture(scope="session")
def migrated_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A migrated SQLite database; copied, for migrating takes longer than most tests."""
    path = tmp_path_factory.mktemp("template") / "template.db"
    open_database(f"sqlite:///{path}").dispose()
    return path


@pytest.fixture(params=["sqlite", "postgresql"])
def url(request: pytest.FixtureRequest, tmp_path: Path, migrated_file: Path) -> str:
    """URL of an empty, migrated database."""
    if request.param == "sqlite":
        shutil.copy(migrated_file, tmp_path / "wayfuse.db")
        return f"sqlite:///{tmp_path / 'wayfuse.db'}"
    server = request.getfixturevalue("postgres")
    return create_database(server, f"w{uuid.uuid4().hex}", template="template")


@pytest.fixture
def engine(url: str) -> Iterator[Engine]:
    """An open database."""
    engine = open_database(url)
    yield engine
    engine.dispose()
