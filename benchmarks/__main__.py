"""All benchmarks: ``python -m benchmarks`` (``make bench``) writes docs/benchmarks.md and docs/benchmarks.json.

    python -m benchmarks [--out docs] [--only hot_path,limit] [--quick]

Peers are in the dependency group ``bench``; one that is not installed is named on the page and not compared. Parts that
read recordings need the data sets (`wayfuse datasets fetch`).
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import warnings
from importlib import import_module
from pathlib import Path

# one thread for every library, before any of them is loaded
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(name, "1")

PARTS = {  # module: seconds it may take
    "hot_path": 60.0,
    "limit": 15.0,
    "filter_step": 25.0,
    "gaussian_process": 60.0,
    "streaming": 8.0,
    "reading": 16.0,
    "growth": 40.0,
    "startup": 20.0,
}


def main() -> int:
    """Run the parts and write the page."""
    from benchmarks.report import machine, page, write

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs")
    parser.add_argument("--only", default="", help="parts to run, separated by commas")
    parser.add_argument(
        "--quick", action="store_true", help="a tenth of the time: to try a part, not to publish"
    )
    options = parser.parse_args()
    chosen = options.only.split(",") if options.only else list(PARTS)
    warnings.simplefilter("ignore")  # of peers
    before, start = machine(), time.perf_counter()
    tables, targets = [], []
    for part in chosen:
        print(f"{time.perf_counter() - start:6.0f} s  {part}", flush=True)
        more, goals = import_module(f"benchmarks.{part}").measure(
            PARTS[part] * (0.1 if options.quick else 1.0)
        )
        tables += more
        targets += goals
    text = page(tables, targets, (before, machine()), time.perf_counter() - start)
    write(options.out, text, tables, targets)
    print(f"{time.perf_counter() - start:6.0f} s  written to {options.out / 'benchmarks.md'}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
