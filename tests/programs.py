"""Programs that tests run besides Python: a test that lacks one is skipped loudly, or fails where they are a must."""

from __future__ import annotations

import os
from typing import NoReturn

import pytest

__all__ = ["REQUIRED", "skip_without"]

REQUIRED = "WAYFUSE_REQUIRE_PROGRAMS"  # set in CI


def skip_without(program: str, why: str) -> NoReturn:
    """Skip for want of a program; fail where the environment says that all must be there."""
    if os.environ.get(REQUIRED):
        pytest.fail(f"{program}: {why}, and {REQUIRED} is set")
    pytest.skip(f"NOT TESTED WITH {program}: {why}")
