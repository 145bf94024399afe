"""Bearer tokens: made once, shown once, stored as a digest, with scopes and perhaps a site and an end.

A token is ``wf_ID_SECRET``; the secret has 256 random bits, so a plain SHA-256 of it cannot be turned round and needs
no slow hash.
"""

from __future__ import annotations

import hashlib
import hmac
import re
from collections.abc import Callable, Iterable
from typing import NamedTuple

from sqlalchemy import Engine, insert, select, update

from wayfuse.core.errors import UsageError
from wayfuse.storage.schema import tokens

__all__ = ["SCOPES", "Token", "TokenStore"]

SCOPES = ("ingest", "read", "survey", "admin")
_ID_BYTES, _SECRET_BYTES = 6, 32
_PREFIX = "wf"
_TOKEN = re.compile(r"[0-9a-z_]{1,200}")


class Token(NamedTuple):
    """What is known of a token, without its secret. ``site`` empty: all sites; times in Unix s."""

    id: str
    scopes: frozenset[str]
    site: str
    label: str
    created: float
    expires: float | None
    revoked: float | None

    def allows(self, scope: str, site: str = "") -> bool:
        """Whether it may do what a scope says, at a site; ``admin`` may do all."""
        return (scope in self.scopes or "admin" in self.scopes) and (not self.site or site in {"", self.site})


_COLUMNS = [c for c in tokens.c if c.name != "digest"]


class TokenStore:
    """Tokens of a database; ``random`` gives so many unpredictable bytes (`secrets.token_bytes`)."""

    def __init__(self, engine: Engine, random: Callable[[int], bytes]) -> None:
        self._engine, self._random = engine, random

    def create(
        self,
        scopes: Iterable[str],
        now: float,
        *,
        site: str = "",
        label: str = "",
        expires: float | None = None,
    ) -> tuple[str, Token]:
        """A new token: its text, which nobody can ask for again, and what is stored of it.

        Raises
        ------
        UsageError : no scope, or one that is not of `SCOPES`.
        """
        wanted = frozenset(scopes)
        if not wanted or not wanted <= set(SCOPES):
            raise UsageError(
                f"scopes must be of {', '.join(SCOPES)}, got {', '.join(sorted(wanted)) or 'none'}",
                where="scopes",
            )
        identifier, secret = self._random(_ID_BYTES).hex(), self._random(_SECRET_BYTES).hex()
        made = Token(identifier, wanted, site, label, now, expires, None)
        row = made._asdict() | {"scopes": " ".join(sorted(wanted)), "digest": _digest(secret)}
        with self._engine.begin() as connection:
            connection.execute(insert(tokens).values(**row))
        return f"{_PREFIX}_{identifier}_{secret}", made

    def verify(self, text: str, now: float) -> Token | None:
        """The token of a text, None where it is none, is revoked or has expired."""
        parts = text.split("_")
        if len(parts) != 3 or parts[0] != _PREFIX or not _TOKEN.fullmatch(text):
            return None
        with self._engine.connect() as connection:
            row = connection.execute(select(tokens).where(tokens.c.id == parts[1])).mappings().first()
        digest = row["digest"] if row is not None else ""
        if not hmac.compare_digest(_digest(parts[2]), digest) or row is None:
            return None
        found = _token([row[c.name] for c in _COLUMNS])
        is_over = found.expires is not None and found.expires <= now
        return None if is_over or found.revoked is not None else found

    def revoke(self, identifier: str, now: float) -> bool:
        """End a token; whether there was one to end."""
        with self._engine.begin() as connection:
            done = connection.execute(
                update(tokens)
                .where(tokens.c.id == identifier, tokens.c.revoked.is_(None))
                .values(revoked=now)
            )
            return bool(done.rowcount)

    def all(self) -> list[Token]:
        """Every token ever made, oldest first."""
        with self._engine.connect() as connection:
            rows = connection.execute(select(*_COLUMNS).order_by(tokens.c.created, tokens.c.id))
            return [_token(list(row)) for row in rows]


def _token(row: list[object]) -> Token:
    made = Token(*row)  # type: ignore[arg-type]  # the columns, in the order of the fields
    return made._replace(scopes=frozenset(str(row[1]).split()))


def _digest(secret: str) -> str:
    return hashlib.sha256(secret.encode()).hexdigest()
