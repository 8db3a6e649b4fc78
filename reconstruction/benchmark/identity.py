"""One identity from its seeds: cut, body, drape, scenes, and the list of its pictures."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import body, figurine, keypoints
from .body import BodySpec
from .body_file import load_body, wearing_body
from .camera import Camera, perspective
from .cutting import Cut, draw_cut
from .drape import Draped, drape
from .mural import draw_camera as mural_camera
from .mural import paint as paint_mural
from .pattern import Pattern, draw_pattern
from .raycast import Caster
from .scene import Scene
from .sewing import SewnMesh, sew
from .splits import HELD_OUT_DAMAGE, Identity
from .textile import draw_camera as textile_camera
from .textile import paint as paint_textile
from .wearing import cut_for, put_on

SIZE = 0.024
"""Edge length of the cloth's mesh, m."""
BODY_SIZE = 0.018
"""Grid of the figure's surface, m."""
WIDTH, HEIGHT = 384, 512


@dataclass(frozen=True)
class Shot:
    """A picture to be taken.

    Parameters
    ----------
    style : {"figurine", "mural", "textile"}
    view : int
        Number within the style.
    damage : int
    seed : int
        Of this picture.
    azimuth : float, optional
        Nominal, degrees, of a figurine that is not taken from one of the usual sides.
    """

    style: str
    view: int
    damage: int
    seed: int
    azimuth: float | None = None

    @property
    def label(self) -> str:
        """End of the file name."""
        return f"{self.style}{self.view}_v{self.seed:08x}_d{self.damage}"


@dataclass(frozen=True)
class Model:
    """Everything that is true about an identity."""

    identity: Identity
    cut: Cut
    spec: BodySpec
    pattern: Pattern
    belt: bool
    mesh: SewnMesh
    draped: Draped
    worn: Scene
    flat: Scene

    @property
    def facts(self) -> dict[str, Any]:
        """JSON form: parameters, panels, seams and figures of the drape."""
        return {
            "identity": dataclasses.asdict(self.identity),
            "cut": {"kind": self.cut.kind, **self.cut.values},
            "body": body.to_dict(self.spec),
            "pattern": dataclasses.asdict(self.pattern),
            "belt": self.belt,
            "drape": {
                "mean_stretch": self.draped.mean_stretch,
                "max_penetration": self.draped.max_penetration,
                "speed": self.draped.speed,
                "crossing_edges": crossing_edges(self.mesh, self.draped.vertices),
            },
            "panels": [
                {
                    "name": p.name,
                    "draped": p.draped,
                    "area": p.area,
                    "warp": p.warp.tolist(),
                    "weft": p.weft.tolist(),
                    "edges": [{"name": e.name, "length": e.length, "points": e.points.tolist()} for e in p.edges],
                }
                for p in self.mesh.garment.panels
            ],
            "seams": [dataclasses.asdict(s) for s in self.mesh.garment.seams],
            "openings": [list(o) for o in self.mesh.garment.openings],
            "anchors": {name: {"panel": a.panel, "uv": list(a.uv)} for name, a in self.mesh.garment.anchors.items()},
        }

    @property
    def arrays(self) -> dict[str, np.ndarray]:
        """Geometry, as listed by :meth:`reconstruction.benchmark.index.BenchmarkIndex.geometry`."""
        return {
            "vertices": self.draped.vertices,
            "faces": self.mesh.faces.astype(np.int32),
            "uv": self.mesh.uv,
            "panel": self.mesh.panel.astype(np.int16),
            "warp": self.mesh.warp(self.draped.vertices),
            "flat": self.mesh.corner_flat,
            "body_vertices": self.worn.body_vertices,
            "body_faces": self.worn.body_faces.astype(np.int32),
            "keypoints": keypoints.place(self.mesh, self.draped.vertices),
            "flat_keypoints": keypoints.place(self.flat.mesh, self.flat.cloth),
            "present": keypoints.present(self.mesh),
        }


def model(identity: Identity, size: float = SIZE, figure: tuple[str, str] | None = None) -> Model:
    """Cut, sew and drape one identity.

    Parameters
    ----------
    identity : Identity
    size : float
        Edge length of the cloth's mesh, m.
    figure : (str, str), optional
        A body's OBJ file and its keypoints, instead of the parametric figure.

    Raises
    ------
    NotConvergedError
        The drape failed.
    SurfaceError
        The mesh size does not suit the cut.
    """
    cut = draw_cut(identity.kind, identity.garment_seed)
    spec = body.draw_body(identity.body_seed, identity.kind)
    if figure is not None:
        spec = wearing_body(load_body(*figure), spec)
    belt = bool(np.random.default_rng([identity.garment_seed, 13]).random() < 0.5) and identity.kind == "round-collar-robe"
    mesh = sew(cut_for(cut, spec), size)
    draped = drape(mesh, put_on(mesh, cut, spec, belt), spec, identity.garment_seed)
    vertices, faces = body.skin(spec, BODY_SIZE)
    worn = Scene(mesh, draped.vertices, vertices, faces, body.joints(spec)["head"], spec.stature, spec.skirt)
    pieces = mesh.unsewn()
    flat = Scene(pieces, pieces.flat, np.zeros((0, 3)), np.zeros((0, 3), dtype=np.int64))
    return Model(identity, cut, spec, draw_pattern(identity.texture_seed), belt, mesh, draped, worn, flat)


def crossing_edges(mesh: SewnMesh, vertices: np.ndarray) -> float:
    """Share of the cloth's edges that pass through another of its faces: the drape keeps vertices apart, not every edge and face.

    Parameters
    ----------
    mesh : SewnMesh
    vertices : (n, 3) array
        m.
    """
    a, b = vertices[mesh.edges[:, 0]], vertices[mesh.edges[:, 1]]
    length = np.linalg.norm(b - a, axis=1)
    caster = Caster(vertices, mesh.faces)
    start, along = a + 0.02 * (b - a), (b - a) / length[:, None]
    face, t = caster.nearest(start, along)
    touches = (mesh.faces[face][:, :, None] == mesh.edges[:, None, :]).any(axis=(1, 2))
    return float(((face >= 0) & ~touches & (t < 0.96 * length)).mean())


def shots(identity: Identity, pictures: int = 0) -> list[Shot]:
    """The pictures of an identity: a figurine from four sides in one state of decay, three murals, one textile; for the test splits
    each style once more at the held-out damage level. With `pictures` so many of these, drawn at random: each is the same as in the
    full set."""
    rng = np.random.default_rng([identity.texture_seed, 17])
    state = int(rng.integers(3))
    plan = [("figurine", v, state) for v in range(len(figurine.AZIMUTHS))]
    plan += [("mural", v, int(rng.integers(3))) for v in range(3)] + [("textile", 0, int(rng.integers(3)))]
    if identity.split.startswith("test"):
        plan += [("figurine", 4, HELD_OUT_DAMAGE), ("mural", 3, HELD_OUT_DAMAGE), ("textile", 1, HELD_OUT_DAMAGE)]
    full = [
        Shot(style, view, damage, int(np.random.SeedSequence([identity.texture_seed, i, 19]).generate_state(1)[0]))
        for i, (style, view, damage) in enumerate(plan)
    ]
    if not 0 < pictures < len(full):
        return full
    chosen = np.random.default_rng([identity.texture_seed, 31]).choice(len(full), pictures, replace=False)
    return [full[i] for i in sorted(chosen)]


def all_round(identity: Identity, count: int) -> list[Shot]:
    """The figurine from `count` sides, evenly, in one state of decay, and the murals and the textile of :func:`shots`."""
    plan = shots(identity)
    state = plan[0].damage
    seeds = np.random.SeedSequence([identity.texture_seed, 37]).generate_state(count)
    taken = [Shot("figurine", k, state, int(seed), 360.0 * k / count) for k, seed in enumerate(seeds)]
    return taken + [s for s in plan if s.style != "figurine"]


def shoot(made: Model, shot: Shot) -> tuple[np.ndarray, np.ndarray, Camera, Scene]:
    """Take a picture.

    Returns
    -------
    image : (512, 384, 3) uint8 array
    intact : (512, 384) bool array
        Where paint or cloth is left.
    camera : Camera
    scene : Scene
        What was in front of it: worn or laid flat.
    """
    texture = made.identity.texture_seed
    if shot.style == "figurine":
        rng = np.random.default_rng([shot.seed, 29])
        nominal = (*figurine.AZIMUTHS, 0.0)[shot.view] if shot.azimuth is None else shot.azimuth
        azimuth = nominal + float(rng.uniform(-6, 6))
        camera = perspective(made.worn.vertices, azimuth, float(rng.uniform(0, 12)), float(rng.uniform(3.6, 5.4)), WIDTH, HEIGHT)
        image = figurine.paint(made.worn, camera, made.pattern, texture, shot.damage, shot.seed)
        return image, np.ones(image.shape[:2], dtype=bool), camera, made.worn
    if shot.style == "mural":
        camera = mural_camera(made.worn.vertices, shot.seed, WIDTH, HEIGHT)
        return *paint_mural(made.worn, camera, made.pattern, texture, shot.damage, shot.seed), camera, made.worn
    camera = textile_camera(made.flat.vertices, shot.seed, WIDTH, HEIGHT)
    return *paint_textile(made.flat, camera, made.pattern, texture, shot.damage, shot.seed), camera, made.flat
