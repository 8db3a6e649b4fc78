"""Run a scene and write what it gives: figures step by step, frames, checkpoint, last state, result."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, InputError
from mfar_fem.scene import Scene
from mfar_fem.simulation.engines import Advance, Engine, engine
from mfar_fem.simulation.files import History, Series, flat, load_checkpoint, save_checkpoint, save_json
from mfar_fem.surface.mesh import Surface

FRAMES = 25
"""About how many frames a run has that does not say how often it wants one."""


@dataclass(frozen=True)
class SimulationResult:
    """What a run reached.

    Attributes
    ----------
    converged : bool
    status, message : str
        ``converged`` or the named failure.
    time : float
        Reached, s.
    nodes, velocities : (nn, 3) arrays
        Last state, m and m/s.
    triangles : (k, 3) array
        Flat triangles of the nodes.
    history : list of dict
        Figures of every step (columns of ``history.csv``).
    payload : dict
        As in ``result.json``.
    """

    converged: bool
    status: str
    message: str
    time: float
    nodes: np.ndarray = field(repr=False)
    velocities: np.ndarray = field(repr=False)
    triangles: np.ndarray = field(repr=False)
    history: list[dict[str, float]] = field(repr=False)
    payload: dict[str, Any] = field(repr=False)


def identity(scene: Scene) -> str:
    """Fingerprint of all that decides the motion; what is only written out does not count."""
    bare = replace(scene, output=replace(scene.output, every=None), bodies=())
    files = [hashlib.sha256(Path(s.path).read_bytes()).hexdigest() for s in scene.sheets if s.path and Path(s.path).is_file()]
    bodies = [(type(b).__name__, sorted((k, _plain(v)) for k, v in vars(b).items())) for b in scene.bodies]
    text = re.sub(r" at 0x[0-9a-f]+", "", repr(bare) + repr(bodies) + "".join(files))
    return hashlib.sha256(text.encode()).hexdigest()[:24]


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if hasattr(value, "__dict__"):
        return sorted((k, _plain(v)) for k, v in vars(value).items())
    return value


def simulate(
    scene: Scene,
    out: str | Path | None = None,
    resume: bool = False,
    restart: bool = False,
    progress: Callable[[dict[str, Any]], None] | None = None,
) -> SimulationResult:
    """Run a scene in time, or to rest.

    Parameters
    ----------
    scene : Scene
    out : path, optional
        Folder for ``history.csv``, ``checkpoint.npz``, ``frames/`` with ``series.pvd``, ``pictures/`` and ``animation.gif``,
        ``last.glb``, ``last.vtu`` and ``result.json``. Without it nothing is written.
    resume : bool
        Go on from the checkpoint in ``out``: to the state of an uninterrupted run, bit by bit on one machine at the draft level and
        with SuperLU, within 1e-12 m with PARDISO, whose rounding depends on where its memory lies; with contact up to the rounding
        of ipctk.
    restart : bool
        Throw away an unfinished run in ``out``.
    progress : callable, optional
        Called after every step with its figures and ``until`` (s, None to rest).

    Returns
    -------
    SimulationResult
        Never raises for a failure to converge.

    Raises
    ------
    InputError
        The scene cannot be run, ``out`` holds an unfinished run, or the start intersects.
    """
    folder = None if out is None else Path(out)
    key = identity(scene)
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
        unfinished = (folder / "checkpoint.npz").exists() and not (folder / "result.json").exists()
        if unfinished and not (resume or restart):
            raise InputError(
                f"'{folder}' holds an unfinished run: --resume goes on with it, --restart begins anew, or choose another --out"
            )
    elif resume:
        raise InputError("there is nothing to resume without a folder: name the --out of the run that was killed")
    if scene.to_rest:
        from mfar_fem.simulation.resting import rest

        return rest(scene, folder, resume, key, progress)
    return _Run(scene, folder, resume, key, progress).go()


class _Run:
    def __init__(self, scene: Scene, folder: Path | None, resume: bool, key: str, progress):
        self.scene, self.folder, self.key, self.progress = scene, folder, key, progress
        begin = perf_counter()
        self.engine: Engine = engine(scene)
        self.duration = float(scene.duration or 0.0)
        dt = scene.level.dt  # frames that were not asked for do not shorten steps
        every = scene.output.every or dt * max(1, round(self.duration / FRAMES / dt))
        count = int(np.floor(self.duration / every * (1 + 1e-12)))
        self.times = [every * i for i in range(count + 1)]
        if self.times[-1] < self.duration * (1 - 1e-9):
            self.times.append(self.duration)
        self.times[-1] = self.duration if abs(self.times[-1] - self.duration) < 1e-9 * self.duration else self.times[-1]
        self.seconds = {"setup": 0.0, "compute": 0.0, "output": 0.0}
        self.resumed_at: float | None = None
        if resume:
            assert folder is not None
            if (folder / "result.json").exists():
                raise DataFileError("this run has ended: there is nothing to resume", path=folder / "result.json")
            self.engine.restore(load_checkpoint(folder / "checkpoint.npz", key))
            self.resumed_at = self.engine.time
        self.output = None if folder is None else Frames(scene, self.engine, folder)
        self.history = None if folder is None else History(folder / "history.csv", self.resumed_at if resume else None)
        self.rows: list[dict[str, float]] = [] if self.history is None else self.history.rows
        if folder is not None and not resume:
            (folder / "result.json").unlink(missing_ok=True)
            self._checkpoint()
        self.seconds["setup"] = perf_counter() - begin

    def go(self) -> SimulationResult:
        outcome = Advance("converged", "", self.engine.time)
        tiny = 1e-9 * self.duration
        for number, t in enumerate(self.times):
            if t > self.engine.time + tiny:
                begin, written = perf_counter(), self.seconds["output"]
                outcome = self.engine.advance(t, self._step)
                self.seconds["compute"] += perf_counter() - begin - (self.seconds["output"] - written)
            if outcome.status != "converged":
                break
            if self.output is not None:
                begin = perf_counter()
                self.output.frame(number, t, fresh=self.resumed_at is None or t >= self.resumed_at - tiny)
                self.seconds["output"] += perf_counter() - begin
        return self._finish(outcome)

    def _step(self, row: dict[str, float]) -> None:
        begin = perf_counter()
        if self.history is not None:
            self.history.add(row)
            self._checkpoint()
        else:
            self.rows.append(row)
        self.seconds["output"] += perf_counter() - begin
        if self.progress is not None:
            self.progress(row | {"until": self.duration})

    def _checkpoint(self) -> None:
        if self.folder is not None:
            save_checkpoint(self.folder / "checkpoint.npz", self.engine.state(), self.key)

    def _finish(self, outcome: Advance) -> SimulationResult:
        scene, e = self.scene, self.engine
        begin = perf_counter()
        files = [] if self.output is None else self.output.close()
        self.seconds["output"] += perf_counter() - begin
        done = outcome.status == "converged"
        reached = e.time - (self.resumed_at or 0.0)
        payload: dict[str, Any] = {
            "scene": scene.name,
            "fabric": scene.fabric.name,
            "fidelity": scene.level.name,
            "order": scene.level.order,
            "converged": done,
            "status": outcome.status,
            "message": outcome.message or f"{e.time:.6g} s simulated",
            "time": e.time,
            "duration": self.duration,
            "steps": len(self.rows),
            "wall_s_per_simulated_s": self.seconds["compute"] / reached if reached > 0 else None,
            "seconds": self.seconds,
            "resumed_at": self.resumed_at,
            "terms": {t.name: t.on for t in scene.explain()},
            **e.summary(),
            "last": self.rows[-1] if self.rows else None,
            "files": files,
        }
        if self.folder is not None:
            save_json(self.folder / "result.json", payload)
        if self.history is not None:
            self.history.close()
        nodes = e.nodes()
        triangles = flat(e.surface, nodes)[1]
        return SimulationResult(
            done, outcome.status, payload["message"], e.time, nodes, e.velocities(), triangles, self.rows, payload
        )


class Frames:
    """Frames of a run: VTU, pictures, and at the end animation and last state."""

    def __init__(self, scene: Scene, e: Engine, folder: Path):
        self.scene, self.engine, self.folder = scene, e, folder
        self.series = Series(folder / "frames") if scene.output.vtu else None
        self.bodies = [(b, *b.mesh()) for b in scene.bodies]
        self.pictures: list[Path] = []
        self.times: list[float] = []
        if scene.output.pictures:
            from mfar_fem.simulation.pictures import Camera

            (folder / "pictures").mkdir(exist_ok=True)
            self.camera = Camera(self._stage(e.surface), scene.output.view)

    def _stage(self, surface: Surface) -> list[np.ndarray]:
        """Points that the run should stay within: the start, what hangs or swings from the supports, what falls, the bodies."""
        nodes, scene = surface.nodes, self.scene
        size = float(np.ptp(nodes, axis=0).max())
        down = np.sign(scene.gravity)
        stage = [nodes]
        kept = [h.support(surface).nodes(surface) for h in scene.holds if h.release is None]
        if kept and scene.has_gravity:
            held = nodes[np.concatenate(kept)]
            reach = float(np.max(np.min(np.linalg.norm(nodes[:, None] - held[None, :: max(1, len(held) // 60)], axis=2), axis=1)))
            stage += [held + reach * down] + ([2 * held.mean(axis=0) - nodes] if scene.releases() else [])
        elif scene.has_gravity:
            stage.append(nodes + 0.4 * size * down)
        stage += [np.clip(v, nodes.min(axis=0) - 0.5 * size, nodes.max(axis=0) + 0.5 * size) for _, v, _ in self.bodies]
        return stage

    def frame(self, number: int, time: float, fresh: bool = True) -> None:
        """Write frame ``number``; of a resumed run those before its checkpoint (``fresh`` False) are there already."""
        e, surface = self.engine, self.engine.surface
        self.times.append(time)
        if self.series is not None:
            if fresh:
                self.series.add(number, time, surface, e.nodes(), e.velocities(), e.fields())
            else:
                self.series.note(number, time)
        if self.scene.output.pictures:
            from mfar_fem.simulation.pictures import draw

            path = self.folder / "pictures" / f"frame-{number:05d}.png"
            if fresh or not path.exists():
                points, triangles, _ = flat(surface, e.nodes())
                placed = [(b.placed(v, time), t) for b, v, t in self.bodies]
                draw(path, self.camera, (points, triangles), placed, f"{self.scene.name}  {self.scene.level.name}  {time:.3f} s")
            self.pictures.append(path)

    def close(self) -> list[str]:
        """Animation and last state; the files written."""
        from mfar_fem.surface.io import write_mesh

        e = self.engine
        points, triangles, parent = flat(e.surface, e.nodes())
        files = [write_mesh(self.folder / "last.glb", points, triangles)]
        fields = {name: values[parent] for name, values in e.fields().items()}
        files.append(write_mesh(self.folder / "last.vtu", points, triangles, {"velocity": e.velocities()[: len(points)]}, fields))
        if self.series is not None:
            files.append(self.folder / "series.pvd")
        if self.scene.output.animation and len(self.pictures) > 1:
            from mfar_fem.simulation.pictures import animate

            step = float(np.median(np.diff(self.times)))
            if (path := animate(self.pictures, self.folder / "animation.gif", step)) is not None:
                files.append(path)
        return [str(f) for f in [*files, self.folder / "history.csv", self.folder / "checkpoint.npz"]]
