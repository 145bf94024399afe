"""Read plan files safely: a size limit before anything is parsed, and XML without a document type.

Entities of XML can only be declared in a document type; refusing it leaves none to expand or to fetch.
"""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

from wayfuse.core.errors import MapError

__all__ = ["LARGEST_FILE", "parse_json", "parse_xml", "read_limited"]

LARGEST_FILE = 64 * 2**20  # bytes; the largest public plan of one building met so far has 3 MB


def read_limited(path: Path, limit: int = LARGEST_FILE) -> bytes:
    """Content of a file of at most ``limit`` bytes.

    Raises
    ------
    MapError : there is no such file, it cannot be read or it is larger.
    """
    try:
        with path.open("rb") as file:
            content = file.read(limit + 1)
    except OSError as error:
        raise MapError(
            f"cannot be read: {error.strerror}", where=path, remedy="name the plan file"
        ) from error
    if len(content) > limit:
        raise MapError(f"larger than {limit / 2**20:.0f} MiB", where=path, remedy="cut out one building")
    return content


def parse_json(content: bytes, where: object) -> Any:
    """Document of a JSON file.

    Raises
    ------
    MapError : it is not JSON.
    """
    try:
        return json.loads(content.decode("utf-8-sig"))
    except (ValueError, RecursionError) as error:
        raise MapError(f"is not JSON: {error}", where=where, remedy="export the plan anew") from error


class _Tree(ET.TreeBuilder):
    """Builds the tree, but refuses a document type (which could declare entities)."""

    def doctype(self, name: str, *_: str | None) -> None:
        raise ValueError(f"holds a document type ({name}), which no plan needs")


def parse_xml(content: bytes, where: object) -> ET.Element:
    """Root element of an XML file.

    Raises
    ------
    MapError : it is not well-formed, or has a document type.
    """
    parser = ET.XMLParser(target=_Tree())  # noqa: S314 - without a document type there are no entities
    try:
        parser.feed(content)
        root = parser.close()
    except (ET.ParseError, ValueError, LookupError) as error:
        raise MapError(f"is not sound XML: {error}", where=where, remedy="export the plan anew") from error
    if not isinstance(root, ET.Element):
        raise MapError("is not sound XML: no element", where=where, remedy="export the plan anew")
    return root
