"""What the machine can do at most, measured in the same run, and how near the filter update comes to it.

    python -m benchmarks.limit

Throughputs of one core on arrays in the first cache: fused multiply-adds, exp, log, sine, square root, wide integer
multiplications and logic, gathers from a table of 256 KB. They are measured twice, compiled by numba from this file and
by the machine's C compiler with its vector mathematics library where there is one; the faster counts. The limit of an
update is the sum over its operations, each at full throughput: no latency, no mispredicted branch, no overlap.
"""

from __future__ import annotations

import ctypes
import math
import shutil
import subprocess
import tempfile
from collections.abc import Callable
from itertools import cycle
from pathlib import Path

import numpy as np

from benchmarks.hot_path import batch_of, model_of
from benchmarks.numpy_filter import start_of
from benchmarks.report import Table, Target
from benchmarks.timing import race
from benchmarks.world import made_up
from wayfuse.core.elementary import exp32, log32, sincos32
from wayfuse.core.jit import fast_kernel, kernel
from wayfuse.core.types import Array32
from wayfuse.models.track_batch import Seen

__all__ = ["measure"]

N = 2048  # elements, in the first cache
TABLE = 65536  # float32, 256 KB
FMAS = 64  # per element and pass
PASSES = 50  # over the arrays in a call, so that the call itself does not count
C_SOURCE = """
#include <math.h>
#include <stdint.h>
#define PASSES 50
#define AGAIN for(int p=0;p<PASSES;p++,({__asm__ volatile("":::"memory");}))for(long i=0;i<n;i++)
void fma_(const float*x,float*y,long n){AGAIN{float m=x[i],a=y[i],b=a+m,c=a-m,d=m;
 for(int k=0;k<16;k++){a=a*b+m;b=b*c+m;c=c*d+m;d=d*a+m;}y[i]=a*b*c*d;}}
void exp_(const float*x,float*y,long n){AGAIN y[i]=expf(x[i]);}
void log_(const float*x,float*y,long n){AGAIN y[i]=logf(x[i]);}
void sincos_(const float*x,float*y,long n){AGAIN y[i]=sinf(x[i])+cosf(x[i]);}
void sqrt_(const float*x,float*y,long n){AGAIN y[i]=sqrtf(x[i]);}
void wide_(const uint64_t*x,uint64_t*y,long n){AGAIN{uint64_t a=x[i],b=a+1;
 for(int k=0;k<8;k++){a=(a&0xffffffffu)*0xD2511F53u;b=(b&0xffffffffu)*0xCD9E8D57u;}y[i]=a^b;}}
void logic_(const uint64_t*x,uint64_t*y,long n){AGAIN{uint64_t a=x[i],b=a+1,c=a+2,d=a+3;
 for(int k=0;k<8;k++){a=(a>>3)^b;b=(b+c)^7;c=(c>>5)^d;d=(d+a)^9;}y[i]=a^b^c^d;}}
void gather_(const float*t,const int*j,float*y,long n){AGAIN y[i]=t[j[i]];}
"""
OPERATIONS = {  # per element of one call of each loop above
    "fma": 2.0 * FMAS, "exp": 1.0, "log": 1.0, "sincos": 1.0, "sqrt": 1.0, "wide": 16.0, "logic": 64.0, "gather": 1.0,
}  # fmt: skip
UNITS = {
    "fma": "multiply-add, floating-point operations", "exp": "exp", "log": "log",
    "sincos": "sine and cosine", "sqrt": "square root",
    "wide": "32 x 32 -> 64 bit multiplication", "logic": "64-bit shift, add or xor",
    "gather": "gather from 256 KB",
}  # fmt: skip
WORK = {  # operations per particle
    # four normals by Philox of ten rounds and Box-Muller, a heading's sine and cosine, the move
    "predict": {"wide": 20, "logic": 40, "log": 2, "sincos": 3, "sqrt": 2, "fma": 30},
    # the clearance alone: the tests of the few that it does not settle are not counted
    "walls, exact": {"gather": 1, "fma": 12},
    "ten ranges": {"sqrt": 10, "fma": 90},
    "weights, moments": {"exp": 1, "fma": 15},
    "resampling, when it happens": {"fma": 3, "gather": 4},
}


@fast_kernel
def _fma(x: Array32, y: Array32) -> None:
    for _ in range(PASSES):
        for i in range(len(x)):
            m, a = x[i], y[i]
            b, c, d = a + m, a - m, m
            for _ in range(16):  # products of two chains: no compiler folds them
                a, b, c, d = a * b + m, b * c + m, c * d + m, d * a + m
            y[i] = a * b * c * d


@fast_kernel
def _exp(x: Array32, y: Array32) -> None:
    for _ in range(PASSES):
        for i in range(len(x)):
            y[i] = exp32(x[i])


@fast_kernel
def _log(x: Array32, y: Array32) -> None:
    for _ in range(PASSES):
        for i in range(len(x)):
            y[i] = log32(x[i])


@fast_kernel
def _sincos(x: Array32, y: Array32) -> None:
    for _ in range(PASSES):
        for i in range(len(x)):
            sine, cosine = sincos32(x[i])
            y[i] = sine + cosine


@fast_kernel
def _sqrt(x: Array32, y: Array32) -> None:
    for _ in range(PASSES):
        for i in range(len(x)):
            y[i] = math.sqrt(x[i])


@kernel
def _gather(table: Array32, at: np.ndarray, y: Array32) -> None:  # type: ignore[type-arg]
    for _ in range(PASSES):
        for i in range(len(y)):
            y[i] = table[np.uint32(at[i])]


def throughputs(seconds: float) -> dict[str, dict[str, float]]:
    """Operations per second by operation and compiler."""
    rng = np.random.default_rng(0)
    x = rng.uniform(0.3, 0.5, N).astype(np.float32)
    y = x.copy()
    whole, out = rng.integers(0, 2**63, N).astype(np.uint64), np.empty(N, np.uint64)
    table, at = rng.random(TABLE, dtype=np.float32), rng.integers(0, TABLE, N).astype(np.int32)
    loops: dict[str, Callable[[], object]] = {
        "numba fma": lambda: _fma(x, y), "numba exp": lambda: _exp(x, y), "numba log": lambda: _log(x, y),
        "numba sincos": lambda: _sincos(x, y), "numba sqrt": lambda: _sqrt(x, y),
        "numba gather": lambda: _gather(table, at, y),
    }  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        library = _c_library(Path(folder))
        if library is not None:
            for name in ("fma", "exp", "log", "sincos", "sqrt"):
                loops[f"C {name}"] = _call(library[f"{name}_"], x, y)
            for name in ("wide", "logic"):
                loops[f"C {name}"] = _call(library[f"{name}_"], whole, out)
            loops["C gather"] = _call(library["gather_"], table, at, y)
        taken = race(loops, seconds=seconds)
    found: dict[str, dict[str, float]] = {}
    for key, t in taken.items():
        compiler, name = key.split()
        found.setdefault(name, {})[compiler] = OPERATIONS[name] * N * PASSES / t.least
    return found


def _call(function: object, *arrays: np.ndarray) -> Callable[[], object]:  # type: ignore[type-arg]
    pointers = [ctypes.c_void_p(a.ctypes.data) for a in arrays]
    length = ctypes.c_long(N)
    return lambda: (arrays, function(*pointers, length))  # type: ignore[operator]


def _c_library(folder: Path) -> ctypes.CDLL | None:
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        return None
    (folder / "limit.c").write_text(C_SOURCE, encoding="utf-8")
    flags = ["-O3", "-march=native", "-mprefer-vector-width=512", "-ffast-math", "-shared", "-fPIC"]
    built = subprocess.run(
        [compiler, *flags, str(folder / "limit.c"), "-o", str(folder / "limit.so"), "-lmvec", "-lm"],
        check=False, capture_output=True,
    )  # fmt: skip
    return ctypes.CDLL(str(folder / "limit.so")) if built.returncode == 0 else None


def measure(seconds: float) -> tuple[list[Table], list[Target]]:
    """Throughputs, the limit of an update, and the share of it that the update reaches."""
    found = throughputs(0.6 * seconds)
    rates = [
        (UNITS[name], *(f"{v[c] / 1e9:.2f}" if c in v else "" for c in ("numba", "C")))
        for name, v in found.items()
    ]
    tables = [
        Table(
            "What one core can do",
            "Thousand millions a second on arrays in the first cache.",
            ("operation", "numba", "C"),
            tuple(rates),
        )
    ]
    if not set(OPERATIONS) <= set(found):
        return tables, [Target("share of the physical limit, ranges and walls", 0.3, None, "")]
    best = {name: max(v.values()) for name, v in found.items()}
    limit = {part: sum(k / best[op] for op, k in work.items()) * 1e9 for part, work in WORK.items()}
    ours, rate = _update(0.4 * seconds)
    limit["resampling, when it happens"] *= rate
    total = sum(limit.values())
    rows = [
        (part, ", ".join(f"{k} {op}" for op, k in WORK[part].items()), f"{ns:.2f}")
        for part, ns in limit.items()
    ]
    rows.append(("whole update, ranges and walls", "", f"{total:.2f}"))
    rows.append(("wayfuse, the same, batch of 100 tracks", "", f"{ours:.2f}"))
    note = (
        f"ns per particle, N = 1000, {rate:.0%} of the updates resample. wayfuse reaches {total / ours:.0%} of the "
        "limit. A sum of throughputs is never reached: it knows neither latency nor mispredicted branches."
    )
    tables.append(Table("The physical limit of an update", note, ("part", "operations", "ns"), tuple(rows)))
    return tables, [Target("share of the physical limit, ranges and walls", 0.3, total / ours, "")]


def _update(seconds: float) -> tuple[float, float]:
    """ns per particle of an update with ranges and walls in a batch, and the share of updates that resampled."""
    world, n, tracks = made_up(), 1000, 100
    model, batch = model_of(world, walls=True), batch_of(start_of(world, n), tracks)
    moments, resampled = cycle(world.moments), []
    rows = np.arange(tracks)

    def run() -> None:
        m = next(moments)
        seen = Seen(ranges=np.tile(m.ranges, (tracks, 1)))
        resampled.append(model.tick(batch, rows, np.tile(m[:2], (tracks, 1)), seen)[:, 7].mean())

    taken = race({"update": run}, seconds=seconds)["update"]
    return taken.least / (n * tracks) * 1e9, float(np.mean(resampled))


def main() -> None:
    tables, targets = measure(10.0)
    for table in tables:
        print(table.title, table.note)
        for row in table.rows:
            print("  ", *row, sep="   ")
    print(targets)


if __name__ == "__main__":
    main()
