"""A scene: sheets, fabric, supports, loads, bodies, duration or "to rest". It is declared; which energies exist follows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.fidelity import LEVELS, Fidelity
from mfar_fem.loads import GRAVITY, Pressure
from mfar_fem.loads import gravity as gravity_load
from mfar_fem.materials.fabric import Fabric
from mfar_fem.sheet import Sheet, build_surface
from mfar_fem.supports import Clamp, Hinge, Support
from mfar_fem.surface.mesh import Surface


@dataclass(frozen=True)
class Hold:
    """Part of a sheet that is held, moved or let go.

    Attributes
    ----------
    where : str or (k, 3) array-like
        Name of a boundary (``left``; with several sheets ``sheet2.left``), or points (m) whose nearest vertices are meant.
    kind : {'hinge', 'clamp'}
        Rotation free or held.
    move : (3,) tuple
        Displacement at load factor 1 (m), see :attr:`Scene.schedule`.
    release : float or None
        Time at which it is let go, s.
    components : tuple of int
        Held components of the position.
    """

    where: object
    kind: str = "hinge"
    move: tuple[float, float, float] = (0.0, 0.0, 0.0)
    release: float | None = None
    components: tuple[int, ...] = (0, 1, 2)

    def support(self, surface: Surface) -> Support:
        """The support on a surface.

        Raises
        ------
        InputError
            Nothing is there, or a clamp is asked of single points.
        """
        if self.kind not in ("hinge", "clamp"):
            raise InputError(f"a support is a 'hinge' or a 'clamp', not '{self.kind}'")
        if isinstance(self.where, str):
            surface.nodes_of(self.where)
            if self.kind == "clamp":
                return Clamp(self.where, self.move, components=self.components)
            return Hinge(self.where, self.components, self.move)
        points = np.atleast_2d(np.asarray(self.where, dtype=float))
        if self.kind == "clamp":
            raise InputError("single points cannot be clamped (they have no edge to hold): use kind = 'hinge' or name a boundary")
        gap = np.linalg.norm(surface.vertices[None] - points[:, None], axis=2)
        ids = gap.argmin(axis=1)
        reach = 1.5 * float(surface.edge_lengths.max())
        far = np.flatnonzero(gap.min(axis=1) > reach)
        if len(far):
            raise InputError(f"support point {points[far[0]].tolist()} m is {gap[far[0]].min():.3g} m away from the nearest vertex")
        return Hinge(np.unique(ids), self.components, self.move, by_node=True)


@dataclass(frozen=True)
class Air:
    """Drag: per area (default) or the paper's per vertex.

    Attributes
    ----------
    normal, tangential : float
        N·s²/m⁴, see :class:`mfar_fem.drag.AirDrag`.
    velocity : (3,) or callable
        Of the air, m/s, or ``air(x, t)`` (Python only).
    per_vertex : float
        γ of formula (16), N·s²/m² a vertex: depends on the mesh.
    """

    normal: float = 0.6
    tangential: float = 0.02
    velocity: object = (0.0, 0.0, 0.0)
    per_vertex: float = 0.0

    @property
    def on(self) -> bool:
        """Whether there is any drag."""
        return self.normal > 0 or self.tangential > 0 or self.per_vertex > 0


BODY_CONTACT = ("auto", "exact", "mesh")


@dataclass(frozen=True)
class Contact:
    """Settings of contact.

    Attributes
    ----------
    distance : float
        At which it begins, m.
    self_contact : bool
        Whether the sheet may touch itself.
    self_friction : float
        Of the sheet on itself.
    bodies : {'auto', 'exact', 'mesh'}
        How the finite-element levels meet bodies: by their exact distance, as closed meshes, or the first where it can be
        (:func:`mfar_fem.contact.exact.why_not`).
    """

    distance: float = 1e-3
    self_contact: bool = False
    self_friction: float = 0.0
    bodies: str = "auto"

    def __post_init__(self):
        if self.bodies not in BODY_CONTACT:
            raise InputError(f"contact: bodies is one of {', '.join(BODY_CONTACT)}; got {self.bodies!r}")


@dataclass(frozen=True)
class Output:
    """What a run writes: a frame every ``every`` seconds (None: 25 a run), as VTU series, pictures, animation."""

    every: float | None = None
    vtu: bool = True
    pictures: bool = True
    animation: bool = True
    view: tuple[float, float] = (20.0, -60.0)


@dataclass(frozen=True)
class Term:
    """An energy of a scene: whether it is on, and why."""

    name: str
    on: bool
    why: str


@dataclass(frozen=True)
class Scene:
    """Everything that defines a computation.

    Attributes
    ----------
    name : str
    sheets : tuple of Sheet
    fabric : Fabric
    holds : tuple of Hold
    bodies : tuple of mfar_fem.contact.body.Body
    duration : float or None
        s; None: to rest.
    gravity : (3,) tuple
        m/s²; zeros: none.
    pressure : float
        Follower pressure, N/m².
    air : Air or None
        None: no drag.
    mass_damping, stiffness_damping : float
        1/s and s, see :class:`mfar_fem.solve.dynamics.DynamicsOptions`.
    contact : Contact
    bending : bool
        False: a membrane, without edge unknowns.
    schedule : tuple of (time, factor)
        Load factor of support displacements and pressure, linear between; empty: 1 throughout.
    velocity : (3,) tuple
        Initial velocity of the sheets, m/s.
    perturbation : (amplitude, seed)
        Random normal displacement of the free vertices at the start: at most ``amplitude`` (m).
    level : Fidelity
    output : Output
    tolerance : float or None
        Local error of a time step, m: the step adapts; None: fixed steps.
    """

    name: str
    sheets: tuple[Sheet, ...]
    fabric: Fabric
    holds: tuple[Hold, ...] = ()
    bodies: tuple = ()
    duration: float | None = 1.0
    gravity: tuple[float, float, float] = GRAVITY
    pressure: float = 0.0
    air: Air | None = None
    mass_damping: float = 0.0
    stiffness_damping: float = 0.0
    contact: Contact = field(default_factory=Contact)
    bending: bool = True
    schedule: tuple[tuple[float, float], ...] = ()
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    perturbation: tuple[float, int] = (0.0, 0)
    level: Fidelity = LEVELS["standard"]
    output: Output = field(default_factory=Output)
    tolerance: float | None = None

    def __post_init__(self):
        if not self.sheets:
            raise InputError(f"scene '{self.name}': there is no sheet")
        if self.duration is not None and not (math.isfinite(self.duration) and self.duration > 0):
            raise InputError(f"scene '{self.name}': the duration must be positive, got {self.duration} s")
        if self.duration is None and any(h.release is not None for h in self.holds):
            raise InputError(f"scene '{self.name}': a support is let go at a time, but the scene runs to rest: give it a duration")
        times = [t for t, _ in self.schedule]
        if any(b <= a for a, b in pairwise(times)):
            raise InputError(f"scene '{self.name}': the times of the schedule must increase, got {times}")

    def with_level(self, level: Fidelity) -> Scene:
        """The same scene at another level of effort."""
        return replace(self, level=level)

    # -- what follows ----------------------------------------------------------------------------------------------------
    @property
    def to_rest(self) -> bool:
        """Whether an equilibrium is wanted instead of a motion."""
        return self.duration is None

    @property
    def has_contact(self) -> bool:
        """Whether anything is searched at all."""
        return bool(self.bodies) or self.contact.self_contact

    @property
    def has_gravity(self) -> bool:
        """Whether the sheet has a weight."""
        return any(self.gravity)

    def explain(self) -> list[Term]:
        """The energies of the scene: which are on, and why."""
        moving = "the scene runs for a time" if not self.to_rest else "the scene runs to rest: an equilibrium has no mass"
        air = self.air is not None and self.air.on and not self.to_rest
        return [
            Term("membrane", True, "a sheet always stretches and shears"),
            Term(
                "bending",
                self.bending,
                "on unless the scene says bending = false" if self.bending else "off by bending = false: no edge unknowns",
            ),
            Term("gravity", self.has_gravity, "gravity is not zero" if self.has_gravity else "gravity is zero"),
            Term("pressure", self.pressure != 0, "a pressure is given" if self.pressure else "no pressure given"),
            Term("inertia", not self.to_rest, moving),
            Term(
                "drag",
                air,
                "[air] has coefficients"
                if air
                else ("at rest nothing moves through the air" if self.to_rest else "no [air] in the scene"),
            ),
            Term(
                "damping",
                not self.to_rest and (self.mass_damping > 0 or self.stiffness_damping > 0),
                "damping coefficients are given" if self.mass_damping or self.stiffness_damping else "no damping given",
            ),
            Term(
                "contact with bodies",
                bool(self.bodies),
                ", ".join(b.name for b in self.bodies) if self.bodies else "no bodies: no search tree",
            ),
            Term(
                "self-contact",
                self.contact.self_contact,
                "asked for" if self.contact.self_contact else "not asked for ([contact] self = true)",
            ),
        ]

    def surface(self, order: int | None = None) -> Surface:
        """The sheets as one surface, meshed for the level (order 0: linear)."""
        return build_surface(self.sheets, self.level, max(1, self.level.order) if order is None else order)

    def supports(self, surface: Surface, time: float = 0.0) -> list[Support]:
        """The supports that still hold at a time (s)."""
        return [h.support(surface) for h in self.holds if h.release is None or h.release > time + 1e-12]

    def releases(self) -> list[float]:
        """Times at which supports are let go, s, within the duration."""
        end = math.inf if self.duration is None else self.duration
        return sorted({h.release for h in self.holds if h.release is not None and h.release < end})

    def factor(self, time: float) -> float:
        """Load factor at a time (s); at rest that of the end of the schedule."""
        if not self.schedule:
            return 1.0
        times, values = zip(*self.schedule, strict=True)
        return float(np.interp(time, times, values))

    def loads(self) -> list:
        """Gravity and pressure."""
        found: list = []
        if self.has_gravity:
            found.append(gravity_load(self.fabric.areal_density, self.gravity, ramp=False))
        if self.pressure:
            found.append(Pressure(self.pressure))
        return found

    def drag(self) -> list:
        """Drag of the air, per area and per vertex."""
        from mfar_fem.drag import AirDrag, VertexDrag

        if self.air is None or self.to_rest:
            return []
        found: list = []
        if self.air.normal > 0 or self.air.tangential > 0:
            found.append(AirDrag(self.air.normal, self.air.tangential, self.air.velocity))
        if self.air.per_vertex > 0:
            found.append(VertexDrag(self.air.per_vertex, self.air.velocity))
        return found

    def barrier(self, surface: Surface):
        """Contact energy of the sheet where it starts (``surface``), or None where nothing can touch."""
        if not self.has_contact:
            return None
        c = self.contact
        if self.meshed_because(surface) is None:
            from mfar_fem.contact.exact import ExactBarrier

            return ExactBarrier(self.bodies, c.distance)
        from mfar_fem.contact.barrier import Barrier

        return Barrier(self.bodies, c.self_contact, dhat=c.distance, self_friction=c.self_friction)

    def meshed_because(self, surface: Surface) -> str | None:
        """Why bodies are met as meshes; None where their exact distance is used."""
        if self.contact.bodies == "mesh":
            return "asked for ([contact] bodies = 'mesh')"
        if self.contact.self_contact:
            reason: str | None = "the sheet may touch itself"
        else:
            from mfar_fem.contact.exact import why_not

            reason = why_not(self.bodies, surface, self.contact.distance)
        if reason is not None and self.contact.bodies == "exact":
            raise InputError(f"[contact] bodies = 'exact' is not possible: {reason}; use 'auto' or 'mesh'")
        return reason

    def start_nodes(self, surface: Surface, supports: Sequence[Support]) -> np.ndarray:
        """Nodes (nn, 3) at the start: the surface with the seeded perturbation, smooth over a few cells, held parts left alone."""
        amplitude, seed = self.perturbation
        nodes = surface.nodes.copy()
        if not amplitude:
            return nodes
        from mfar_fem.sheet import smooth_noise

        shift = amplitude * smooth_noise(surface, seed)
        for support in supports:
            shift[support.nodes(surface)] = 0.0
        return nodes + shift
