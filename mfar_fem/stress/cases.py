"""The space of extremes: a case is a few numbers from which mesh, fabric, supports, loads and solver settings follow.

``draw(seed, index)`` gives the same case on every machine; a case can also be written down by hand, as for the named extremes.
"""

from __future__ import annotations

import contextlib
import math
from dataclasses import asdict, dataclass, field, replace

import numpy as np

from mfar_fem.errors import InputError, ParameterError
from mfar_fem.loads import GRAVITY, edge_load, gravity
from mfar_fem.materials import Bending, Fabric
from mfar_fem.materials.law import get_law, law_names
from mfar_fem.supports import Clamp, Hinge
from mfar_fem.surface import Surface

KINDS = ("statics", "rest", "dynamics")
SUPPORTS = ("clamped", "corners", "pulled")
SLIVERS = ("column", "graded", "needles")

RANGES = {"dt": (1e-4, 1.0), "stiffness": (1e1, 1e7), "bending": (1e-9, 1e-2), "thickness": (1e-6, 5e-3), "chain_nu": (0.34, 1e3),
          "aspect": (1.0, 1e3), "gravity": (1.0, 100.0), "compression": (0.0, 0.2), "stretch": (0.0, 0.99)}
"""Ends of the space: s, N/m, N·m, m, –, –, multiples of g, share, share of the locking stretch."""


@dataclass(frozen=True)
class Case:
    """One problem of the stress test; all lengths in m, times in s.

    Attributes
    ----------
    kind : {'statics', 'rest', 'dynamics'}
        :func:`solve_static` in one load step, :func:`relax`, or a few steps of :class:`Dynamics`.
    order : {1, 2}
    cells : (int, int)
        Along and across; ``diagonals`` the pattern of :mod:`mfar_fem.surface.patterns`.
    sliver, aspect : str, float
        How cells are made thin, and by which factor: one ``column`` of cells, columns ``graded`` towards the support, or thin
        ``needles`` along all rows.
    law : str
    shape : dict
        Parameters of the law other than moduli; the moduli are scaled to ``stiffness``.
    stiffness : float
        Larger of the two membrane stiffnesses at rest, N/m.
    bending, twist : float
        Rigidity of warp and weft, N·m, and share of the twist.
    support : {'clamped', 'corners', 'pulled'}
        Left edge clamped; the two left corners held; both ends hinged and the right one moved.
    stretch : float
        ``pulled``: elongation as a share of what locks the law in a wide strip (laws that do not lock below 200 %: of 50 %);
        negative: ends brought together by that share of the length.
    compression : float
        Share by which the start is shorter than the cloth along the warp.
    weight : float
        Multiple of standard gravity.
    pull : float
        N/m on the right edge along x, ``clamped`` in statics and dynamics.
    dt, method, mass, steps
        Of the dynamics.
    """

    seed: int = 0
    index: int = -1
    kind: str = "statics"
    order: int = 1
    cells: tuple[int, int] = (6, 4)
    diagonals: str = "union"
    size: tuple[float, float] = (0.2, 0.1)
    sliver: str = "column"
    aspect: float = 1.0
    law: str = "st-venant-kirchhoff"
    shape: dict = field(default_factory=dict)
    stiffness: float = 1e3
    bending: float = 1e-6
    twist: float = 0.4
    thickness: float = 2e-4
    density: float = 500.0
    support: str = "clamped"
    stretch: float = 0.0
    compression: float = 0.0
    weight: float = 1.0
    pull: float = 0.0
    dt: float = 2e-3
    method: str = "implicit-euler"
    mass: str = "consistent"
    steps: int = 3

    def to_dict(self) -> dict:
        """Plain values, for JSON."""
        return asdict(self)

    # -- the parts ---------------------------------------------------------------------------------------------------------
    def surface(self) -> Surface:
        """The flat mesh."""
        from mfar_fem.surface.patterns import strip

        (nx, ny), (length, width) = self.cells, self.size
        pattern = strip(length, width, nx, ny, self.diagonals)
        vertices = pattern.vertices.copy()
        cell = length / nx
        if self.sliver == "needles":
            vertices[:, 1] *= (cell * ny / width) / self.aspect
        else:
            vertices[:, 0] = np.interp(vertices[:, 0], np.linspace(0.0, length, nx + 1), self._columns(width / ny))
        return Surface(vertices, pattern.triangles, self.order, boundary=pattern.boundary)

    def _columns(self, height: float) -> np.ndarray:
        """Positions (nx + 1,) of the grid lines: the thinnest column is ``aspect`` times narrower than a row is high."""
        nx, length = self.cells[0], self.size[0]
        widths: np.ndarray = np.ones(nx)
        thinnest = height / self.aspect
        if self.aspect > 1.0 and self.sliver == "column":
            widths[:] = (length - thinnest) / (nx - 1)
            widths[nx // 2] = thinnest
        elif self.aspect > 1.0:
            low, high = 1e-6, 1.0  # ratio of neighbours
            for _ in range(80):
                ratio = math.sqrt(low * high)
                widths = ratio ** np.arange(nx)[::-1]
                widths *= length / widths.sum()
                low, high = (low, ratio) if widths[0] > thinnest else (ratio, high)
        lines = np.concatenate([[0.0], np.cumsum(widths)])
        return lines * (length / lines[-1])

    def fabric(self) -> Fabric:
        """The fabric: moduli scaled so that the stiffer direction has ``stiffness`` at rest."""
        law = get_law(self.law, **self.shape)
        scale = self.thickness if law.basis == "volume" else 1.0
        now = scale * np.diag(law.tangent_at_rest())[:2].max()
        moduli = {p.name: law.values[p.name] * self.stiffness / now for p in law.parameters if p.unit in ("Pa", "N/m")}
        b = self.bending
        return Fabric(f"case {self.index}", law.replace(**moduli), self.thickness, self.density * self.thickness,
                      Bending(b, b, self.twist * b))

    def elongation(self) -> float:
        """Displacement of the right end over the length, ``pulled`` strips."""
        if self.stretch <= 0.0:
            return self.stretch
        limit = locking_strain(get_law(self.law, **self.shape))
        return self.stretch * (limit if limit <= 2.0 else 0.5)

    def supports(self, surface: Surface) -> list:
        """Supports on the mesh."""
        if self.support == "clamped":
            return [Clamp("left")]
        if self.support == "corners":
            ids = surface.boundary["left"]
            return [Hinge(np.array([ids[0], ids[-1]]), by_node=True)]
        if self.support != "pulled":
            raise InputError(f"unknown support '{self.support}'; choose one of {', '.join(SUPPORTS)}")
        return [Hinge("left"), Hinge("right", displacement=(self.elongation() * self.size[0], 0.0, 0.0))]

    def acceleration(self) -> np.ndarray:
        """Gravity (3,), m/s²; along the sheet where a flat static sheet hangs by two corners (it could not swing there)."""
        g = self.weight * np.asarray(GRAVITY)
        return np.array([-g[2], 0.0, 0.0]) if self.kind == "statics" and self.support == "corners" else g

    def loads(self) -> list:
        """Weight, and the pull where there is one."""
        loads = [gravity(self.density * self.thickness, self.acceleration())]
        if self.pull:
            loads.append(edge_load("right", (self.pull, 0.0, 0.0)))
        return loads

    def start(self, problem):
        """State to start from: the reference, shortened by ``compression``, strips stretched with their ends; None: the default.

        A pulled strip at rest starts from the even stretch, everything else from where its supports are at the beginning.
        """
        factor = 1.0 - self.compression
        if self.support == "pulled" and self.kind == "rest":
            factor = 1.0 + self.elongation()
        if factor == 1.0:
            return None
        state = problem.start()
        u = state.u.copy()
        x = u[: problem.shell.alpha_offset].reshape(-1, 3)
        x[:, 0] *= factor
        return state.with_u(u)


def locking_strain(law, limit: float = 50.0) -> float:
    """Elongation of the warp, the weft held, at which a law's energy is infinite or its tension 1e8 times its stiffness.

    inf where neither happens below ``limit``; the second ends the exponential laws short of numbers without a square.
    """
    stiffness = law.tangent_at_rest()[0, 0]

    def below(strain):
        energy, stress, _ = law.evaluate(np.array([[(1.0 + strain) ** 2, 1.0, 0.0]]), 1)
        return bool(np.isfinite(energy[0]) and stress[0, 0] < 1e8 * stiffness)

    if below(limit):
        return math.inf
    low, high = 0.0, limit
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if below(middle) else (low, middle)
    return low


def draw(seed: int, index: int) -> Case:
    """Case ``index`` of the space with ``seed``.

    Raises
    ------
    InputError
        Negative seed or index.
    """
    if seed < 0 or index < 0:
        raise InputError(f"seed and index of a case must not be negative, got {seed} and {index}")
    rng = np.random.default_rng([seed, index])

    def log(name):
        low, high = RANGES[name]
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    def pick(options, p=None):
        return options[int(rng.choice(len(options), p=p))]

    kind, order, support = pick(KINDS), int(rng.integers(1, 3)), pick(SUPPORTS)
    law = pick(law_names())
    shape = _shape(law, rng, log)
    nx, ny = int(rng.integers(3, 9)), int(rng.integers(2, 7))
    aspect = log("aspect") if rng.random() < 0.6 else 1.0
    size = (0.2, 0.2 * ny / nx)
    stretch = compression = pull = 0.0
    if support == "pulled":
        toward = rng.random()
        if toward < 0.25:
            compression = float(rng.uniform(*RANGES["compression"]))
            stretch = -compression
        else:
            stretch = float(1.0 - 10 ** rng.uniform(-2.0, 0.0)) if toward < 0.6 else float(rng.uniform(*RANGES["stretch"]))
            stretch = min(stretch, RANGES["stretch"][1])
            compression = 0.0
    elif rng.random() < 0.4:
        compression = float(rng.uniform(*RANGES["compression"]))
    stiffness = log("stiffness")
    if support == "clamped" and rng.random() < 0.3:
        pull = stiffness * float(10 ** rng.uniform(-4.0, -1.0))
    if kind == "dynamics" and support == "pulled":
        compression = 0.0  # its ends start where the cloth is and move during the run
    case = Case(seed=seed, index=index, kind=kind, order=order, cells=(nx, ny), size=size,
                diagonals=pick(("right", "union", "criss")),
                sliver=pick(SLIVERS), aspect=aspect, law=law, shape=shape, stiffness=stiffness, bending=log("bending"),
                twist=float(rng.uniform(0.2, 0.5)), thickness=log("thickness"), density=float(rng.uniform(200.0, 1300.0)),
                support=support, stretch=stretch, compression=compression,
                weight=log("gravity") if rng.random() < 0.7 else 1.0, pull=pull, dt=log("dt"),
                method=pick(("implicit-euler", "bdf2", "generalized-alpha"), (0.5, 0.25, 0.25)),
                mass=pick(("consistent", "lumped")), steps=int(rng.integers(2, 6)))
    for _ in range(60):
        with contextlib.suppress(ParameterError):  # a modulus beyond 1e13 Pa: a thicker sheet has the stiffness with less
            case.fabric()
            break
        case = replace(case, thickness=1.5 * case.thickness)
    return case


def _shape(law: str, rng, log) -> dict:
    """Parameters of a law before its moduli are scaled; the rest keeps the defaults."""
    def between(low, high):
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    if law in ("eight-chain-silk", "eight-chain-literal"):
        out = {"nu": log("chain_nu")}
        return out if law == "eight-chain-literal" else out | {"eta": float(rng.uniform(0.0, 4.0))}
    if law == "st-venant-kirchhoff":
        return {"Ef": 1e7 * between(0.2, 1.0), "nu": float(rng.uniform(0.0, 0.45)), "G": 1e7 * between(3e-3, 0.4)}
    if law == "yarn-network":
        return {"Lw": between(0.03, 0.3), "Lf": between(0.03, 0.3), "G": between(0.1, 100.0), "Ls": between(0.3, 2.0)}
    if law == "fung":
        return {"A1": between(5.0, 2e3), "A2": between(5.0, 2e3), "A3": between(1.0, 50.0)}
    if law == "gasser-ogden-holzapfel":
        return {"k2w": between(1.0, 200.0), "k2f": between(1.0, 200.0), "kappa": float(rng.uniform(0.0, 0.3))}
    if law == "arruda-boyce":
        return {"N": between(1.2, 1e3)}
    if law == "bischoff":
        return {name: between(1.3, 5.0) for name in "abc"}
    if law == "neo-hookean-compressible":
        return {"kappa": 1e5 * between(0.5, 100.0)}
    return {}
