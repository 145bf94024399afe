"""Rays in a building by Sionna RT [1]_, an optional extra: ``pip install 'wayfuse[sionna]'`` and an LLVM library.

Antennas radiate alike in all directions, vertically polarised. Mean levels are path gains over squares of a raster at
the phone's height, by rays sent out at random and counted where they pass; the channel's rays are exact paths to the
raster's places. Diffraction and rough surfaces are left out: behind metal it is darker than in truth.

The tracer runs in processes of its own, each with one thread: its sums over several threads differ from run to run in
their last bits, and a library that does not fit the processor ends the process that loads it, not the caller.

References
----------
.. [1] F. Aït Aoudia, J. Hoydis, M. Nimier-David, B. Nicolet, S. Cammerer, A. Keller, Sionna RT: Technical Report,
   2025, arXiv:2504.21719.
"""

from __future__ import annotations

import multiprocessing
import os
import re
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from wayfuse.core.cores import usable_cores
from wayfuse.core.errors import ConfigError
from wayfuse.core.types import Array, BoolArray, IntArray
from wayfuse.simulator.building import Building
from wayfuse.simulator.extrusion import Surfaces, slab_surfaces, wall_surfaces
from wayfuse.simulator.free_space import first_metre_db
from wayfuse.simulator.rays import SILENT_DB, ChannelRays, Raster, RayField, RaysModel

__all__ = ["Antennas", "Work", "newest_library", "trace_rays"]

_TOGETHER = 4  # antennas traced at a time: a million rays each take about a gigabyte
_KEPT = 32  # strongest rays of a channel
_LLVM = "DRJIT_LIBLLVM_PATH"
_LIBRARIES = ("/usr/lib/*/libLLVM*.so*", "/usr/lib/llvm-*/lib/libLLVM*.so*", "/usr/lib64/libLLVM*.so*")
_REMEDY = f"install a new LLVM (19 is known to work; Debian: libllvm19), or name its library in {_LLVM}"
_ROUNDED_DB = 2  # decimals kept of a level
_scene: _Scene | None = None  # of a process of the pool


class Work(NamedTuple):
    """How long work is done: in ``jobs`` processes (None: all cores), its parts passed on as they come by ``progress``,
    which is told how many there will be."""

    jobs: int | None = None
    progress: Callable[[Iterable[Any], int], Iterable[Any]] = lambda done, _: done


class Antennas(NamedTuple):
    """Of radios (r,): place (r, 3) m, carrier (r,) Hz, and whether the channel's rays are wanted (r,)."""

    place: Array
    carrier: Array
    has_channel: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class _Scene:
    walls: Surfaces
    slabs: Surfaces
    model: RaysModel
    seed: int


class _Task(NamedTuple):
    """Antennas (a,) of one carrier, on one storey's raster at a height (m)."""

    radios: IntArray
    place: Array
    carrier: float
    floor: int
    raster: Raster
    height: float
    is_channel: bool


def trace_rays(
    building: Building,
    model: RaysModel,
    antennas: Antennas,
    heights: tuple[float, float],
    seed: int,
    work: Work = Work(),
) -> RayField:
    """Levels and channels of all radios on all storeys.

    Parameters
    ----------
    heights : m, of the phone above its floor, and of the top storey.
    work : processes and progress, without influence on the result.

    Raises
    ------
    ConfigError : Sionna RT or a library that it needs is missing.
    """
    if find_spec("sionna") is None:
        raise ConfigError('radio.model = "rays" needs Sionna RT', remedy="pip install 'wayfuse[sionna]'")
    phone, ceiling = heights
    scene = _Scene(wall_surfaces(building, ceiling), slab_surfaces(building, ceiling), model, seed)
    tasks = _tasks(building, model, antennas, phone)
    n = len(antennas.carrier)
    rasters = tuple(Raster.over(storey.outline, model.raster_m) for storey in building.storeys)
    gain = tuple(np.full((n, r.rows, r.columns), SILENT_DB, dtype=np.float32) for r in rasters)
    channels = _no_channels(building, model, n) if antennas.has_channel.any() else ()
    for task, result in work.progress(_traced(scene, tasks, work.jobs), len(tasks)):
        if task.is_channel:
            there = channels[task.floor]
            for kept, new in zip((there.delay, there.amplitude, there.azimuth), result, strict=True):
                kept[task.radios] = new
        else:
            with np.errstate(divide="ignore"):
                level = np.maximum(10.0 * np.log10(result) + first_metre_db(task.carrier), SILENT_DB)
            gain[task.floor][task.radios] = np.round(level, _ROUNDED_DB)
    return RayField(rasters, gain, channels)


def _tasks(building: Building, model: RaysModel, antennas: Antennas, phone: float) -> list[_Task]:
    out = []
    for carrier in np.unique(antennas.carrier).tolist():
        at = antennas.carrier == carrier
        for is_channel, size in ((False, model.raster_m), (True, model.channel_raster_m)):
            radios = np.flatnonzero(at & (antennas.has_channel | (not is_channel)))
            for floor, storey in enumerate(building.storeys):
                raster, z = Raster.over(storey.outline, size), storey.elevation + phone
                for k in range(0, len(radios), _TOGETHER):
                    some = radios[k : k + _TOGETHER]
                    out.append(_Task(some, antennas.place[some], carrier, floor, raster, z, is_channel))
    return out


def _no_channels(building: Building, model: RaysModel, n: int) -> tuple[ChannelRays, ...]:
    out = []
    for storey in building.storeys:
        raster = Raster.over(storey.outline, model.channel_raster_m)
        shape = n, raster.rows * raster.columns, _KEPT
        real = [np.zeros(shape, dtype=np.float32) for _ in range(2)]
        out.append(ChannelRays(raster, real[0], np.zeros(shape, dtype=np.complex64), real[1]))
    return tuple(out)


def _traced(scene: _Scene, tasks: Sequence[_Task], jobs: int | None) -> Iterable[tuple[_Task, Any]]:
    """Each task with its result, in order."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(min(jobs or usable_cores(), len(tasks)), spawn, _begin, (scene,)) as pool:
        try:
            yield from zip(tasks, pool.map(_run, tasks), strict=True)
        except (BrokenProcessPool, ImportError) as error:
            raise ConfigError("the ray tracer could not start", remedy=_REMEDY) from error


# --- in the processes of the pool ---------------------------------------------------------------------------


def _begin(scene: _Scene) -> None:
    global _scene  # noqa: PLW0603 (a pool's processes have no other place for what they were given)
    if not os.environ.get(_LLVM) and (library := newest_library()):
        os.environ[_LLVM] = library
    _scene = scene


@cache
def _tracer() -> _Tracer:
    assert _scene is not None  # noqa: S101
    return _Tracer(_scene)  # with the first task: what goes wrong here, the caller hears of


def _run(task: _Task) -> Any:
    return _tracer().channel(task) if task.is_channel else _tracer().levels(task)


def newest_library() -> str:
    """The newest LLVM of the usual folders, or "": the loader's own choice may be too old for the processor."""
    found = [path for pattern in _LIBRARIES for path in Path("/").glob(pattern.lstrip("/"))]
    numbered = [
        (int(m[1]), str(path)) for path in found if (m := re.search(r"LLVM[-.a-z]*?(\d+)", path.name))
    ]
    return max(numbered, default=(0, ""))[1]


class _Tracer:
    """A scene in Sionna RT."""

    def __init__(self, scene: _Scene) -> None:
        import drjit
        import mitsuba
        import sionna.rt

        drjit.set_thread_count(1)
        self._mi, self._rt, self._model, self._seed = mitsuba, sionna.rt, scene.model, scene.seed
        model = scene.model
        self._scene = sionna.rt.load_scene()
        self._scene.edit(
            add=[
                self._object("walls", scene.walls, model.wall_material, model.wall_m),
                self._object("slabs", scene.slabs, model.slab_material, model.slab_m),
            ]
        )
        antenna = sionna.rt.PlanarArray(
            num_rows=1,
            num_cols=1,
            vertical_spacing=0.5,
            horizontal_spacing=0.5,
            pattern="iso",
            polarization="V",
        )
        self._scene.tx_array = self._scene.rx_array = antenna

    def _object(self, name: str, surfaces: Surfaces, material: str, thickness: float) -> Any:
        mi = self._mi
        mesh = mi.Mesh(name, len(surfaces.corners), len(surfaces.triangles))
        parameters = mi.traverse(mesh)
        parameters["vertex_positions"] = mi.Float(surfaces.corners.astype(np.float32).ravel())
        parameters["faces"] = mi.UInt32(surfaces.triangles.astype(np.uint32).ravel())
        parameters.update()
        kind = self._rt.ITURadioMaterial(f"{name} {material}", material, thickness)
        return self._rt.SceneObject(mi_mesh=mesh, name=name, radio_material=kind)

    def _place(self, task: _Task) -> None:
        for device in (*self._scene.transmitters, *self._scene.receivers):
            self._scene.remove(device)
        self._scene.frequency = task.carrier
        for k, place in enumerate(task.place.tolist()):
            self._scene.add(self._rt.Transmitter(f"ap {k}", position=self._mi.Point3f(*place)))

    def levels(self, task: _Task) -> NDArray[np.float32]:
        """Path gain (a, rows, columns), of powers."""
        self._place(task)
        raster, mi = task.raster, self._mi
        across = raster.size * raster.columns, raster.size * raster.rows
        gains = self._rt.RadioMapSolver()(
            self._scene,
            center=mi.Point3f(raster.x0 + 0.5 * across[0], raster.y0 + 0.5 * across[1], task.height),
            orientation=mi.Point3f(0.0, 0.0, 0.0),
            size=mi.Point2f(*across),
            cell_size=mi.Point2f(raster.size, raster.size),
            samples_per_tx=self._model.samples,
            max_depth=self._model.interactions,
            refraction=True,
            seed=self._seed,
        )
        return np.asarray(gains.path_gain, dtype=np.float32)

    def channel(self, task: _Task) -> tuple[Array, NDArray[np.complex64], Array]:
        """Delay ns, amplitude and azimuth rad of the strongest rays, (a, places, k) each."""
        self._place(task)
        places = task.raster.places
        for k, (x, y) in enumerate(places.tolist()):
            self._scene.add(self._rt.Receiver(f"phone {k}", position=self._mi.Point3f(x, y, task.height)))
        paths = self._rt.PathSolver()(
            self._scene,
            max_depth=self._model.channel_interactions,
            refraction=True,
            synthetic_array=True,
            seed=self._seed,
        )
        real, imaginary = (np.asarray(part)[:, 0, :, 0] for part in paths.a)  # (places, a, paths)
        valid = np.asarray(paths.valid)
        amplitude = np.where(valid, real + 1j * imaginary, 0.0).astype(np.complex64)
        strongest = np.argsort(-np.abs(amplitude), axis=2, kind="stable")[..., :_KEPT]
        out = []
        for values in (np.asarray(paths.tau) * 1e9, amplitude, np.asarray(paths.phi_r)):
            kept = np.take_along_axis(np.where(valid, values, 0.0), strongest, axis=2).swapaxes(0, 1)
            missing = _KEPT - kept.shape[2]
            out.append(np.pad(kept, ((0, 0), (0, 0), (0, missing))))
        return out[0], out[1], out[2]
