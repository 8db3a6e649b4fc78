"""One way to drive the levels of a scene: finite elements in time, position-based dynamics, relaxation to rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from mfar_fem.errors import InputError
from mfar_fem.scene import Scene
from mfar_fem.shell import State
from mfar_fem.solve.dynamics import Dynamics, DynamicsOptions, Motion, StepRecord
from mfar_fem.solve.integrators import Kinematics
from mfar_fem.surface import Surface

Report = Callable[[dict[str, float]], None]


@dataclass(frozen=True)
class Advance:
    """How an advance ended: ``status`` is ``converged`` or the name of the failure, ``time`` where it is now (s)."""

    status: str
    message: str
    time: float


class Engine(Protocol):
    """What the run needs of a level."""

    surface: Surface

    @property
    def time(self) -> float:
        """s."""

    def advance(self, until: float, report: Report) -> Advance:
        """Go on to a time (s), with a row of figures for every step."""

    def nodes(self) -> np.ndarray:
        """Deformed nodes (nn, 3), m."""

    def velocities(self) -> np.ndarray:
        """(nn, 3), m/s."""

    def fields(self) -> dict[str, np.ndarray]:
        """Fields by triangle for the files."""

    def state(self) -> dict[str, np.ndarray]:
        """All that a resumed run needs."""

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Take up a state."""

    def summary(self) -> dict[str, Any]:
        """Figures for ``result.json``."""


SUMS = ("dissipated", "work", "first_energy", "to_come")
"""What a :class:`~mfar_fem.solve.dynamics.Motion` carries along besides its state."""


class FiniteElements:
    """Orders 1 and 2 in time; supports that let go split the run into phases."""

    def __init__(self, scene: Scene):
        self.scene, self.surface = scene, scene.surface()
        level = scene.level
        self.options = DynamicsOptions(
            method=level.method,
            dt=level.dt,
            rtol=level.rtol,
            mass_damping=scene.mass_damping,
            stiffness_damping=scene.stiffness_damping,
            tolerance=scene.tolerance,
            linear_solver=level.linear_solver,
            mass="lumped" if level.order == 1 else "consistent",
            iteration_error=level.error_left(scene.has_contact),
        )
        self.totals: dict[str, Any] = {
            "newton_iterations": 0,
            "wasted_iterations": 0,
            "halvings": 0,
            "inexact_steps": 0,
            "assembly_s": 0.0,
            "solve_s": 0.0,
        }
        self.notes: list[str] = []
        self.dynamics = self._phase(0.0)
        nodes = scene.start_nodes(self.surface, scene.supports(self.surface))
        if scene.perturbation[0]:
            self.dynamics = self._phase(0.0, nodes)

    def _phase(self, time: float, nodes: np.ndarray | None = None, motion: Motion | None = None) -> Dynamics:
        scene = self.scene
        start = None if nodes is None else self.dynamics.problem.state_at(nodes)
        velocity = (
            np.broadcast_to(np.asarray(scene.velocity, dtype=float), self.surface.nodes.shape) if any(scene.velocity) else None
        )
        found = Dynamics(
            self.surface,
            scene.fabric,
            scene.supports(self.surface, time),
            scene.loads(),
            scene.drag(),
            scene.barrier(self.surface),
            self.options,
            scene.bending,
            scene.factor if scene.schedule else None,
            start,
            velocity,
        )
        if motion is not None:
            found.resume(motion)
            if scene.has_contact:
                found.contact.restore(self.dynamics.contact.memory())
                found.contact.check_start(found.problem.shell, motion.state, motion.time)
        self._time = time
        return found

    @property
    def time(self) -> float:
        """s."""
        return self.dynamics.motion.time

    @property
    def barrier(self):
        """The contact energy, or None."""
        return self.dynamics.contact

    def advance(self, until: float, report: Report) -> Advance:
        for stop in [*(t for t in self.scene.releases() if self._time < t < until), until]:
            result = self.dynamics.run(stop, lambda record: report(_row(record)))
            for key, value in (
                ("newton_iterations", result.newton_iterations),
                ("wasted_iterations", result.wasted_iterations),
                ("halvings", result.halvings),
                ("inexact_steps", result.inexact_steps),
                ("assembly_s", result.timings["assembly"]),
                ("solve_s", result.timings["solve"]),
            ):
                self.totals[key] += value
            self.notes += [n for n in result.notes if n not in self.notes]
            if not result.converged:
                return Advance(result.status, result.message, self.time)
            if stop in self.scene.releases():
                self.dynamics = self._phase(stop, motion=self.dynamics.motion)
        return Advance("converged", "", self.time)

    def nodes(self) -> np.ndarray:
        return self.dynamics.problem.shell.positions(self.dynamics.motion.state)

    def velocities(self) -> np.ndarray:
        return self.dynamics.motion.kinematics.v.reshape(-1, 3)

    def fields(self) -> dict[str, np.ndarray]:
        return shell_fields(self.dynamics.problem.shell, self.dynamics.motion.state)

    def state(self) -> dict[str, np.ndarray]:
        m = self.dynamics.motion
        found = {"u": m.state.u, "directors": m.state.directors, "phase": np.array(self._time)}
        found |= {f"motion_{k}": np.array(getattr(m, k)) for k in ("time", "dt", "step", *SUMS)}
        found |= {f"k_{f.name}": np.asarray(v) for f in fields(Kinematics) if (v := getattr(m.kinematics, f.name)) is not None}
        found |= {f"strain_{i}": v for i, v in enumerate(m.strain)}
        if self.barrier is not None:
            found |= {f"contact_{k}": np.array(v) for k, v in self.barrier.memory().items()}
        return found

    def restore(self, state: dict[str, np.ndarray]) -> None:
        kept: dict[str, Any] = {
            f.name: (float(v) if f.name == "dt_old" else v)
            for f in fields(Kinematics)
            if (v := state.get(f"k_{f.name}")) is not None
        }
        kinematics = Kinematics(**kept)
        strain = tuple(state[f"strain_{i}"] for i in range(sum(k.startswith("strain_") for k in state)))
        motion = Motion(
            float(state["motion_time"]),
            State(state["u"], state["directors"]),
            kinematics,
            float(state["motion_dt"]),
            int(state["motion_step"]),
            strain,
            *(float(state[f"motion_{k}"]) for k in SUMS if f"motion_{k}" in state),
        )
        if float(state["phase"]) != self._time:
            self.dynamics = self._phase(float(state["phase"]))
        self.dynamics.resume(motion)
        if self.barrier is not None:
            self.barrier.restore({k[8:]: float(v) for k, v in state.items() if k.startswith("contact_")})
            self.barrier.check_start(self.dynamics.problem.shell, motion.state, motion.time)

    def summary(self) -> dict[str, Any]:
        return {"unknowns": self.dynamics.problem.n, "elements": len(self.surface.elements), **self.totals, "notes": self.notes}


class PositionLevel:
    """Order 0, the draft level."""

    def __init__(self, scene: Scene):
        from mfar_fem.solve.position_based import PositionBased

        if scene.pressure:
            raise InputError("the draft level (position-based dynamics) has no pressure: use fidelity 'standard'")
        if scene.stiffness_damping or (scene.air is not None and scene.air.per_vertex):
            raise InputError("the draft level has neither stiffness damping nor drag per vertex: use fidelity 'standard'")
        self.scene, self.surface = scene, scene.surface(1)
        self._make, self._time, self._wall = PositionBased, 0.0, 0.0
        self.model = self._phase(0.0)

    def _phase(self, time: float):
        scene, level = self.scene, self.scene.level
        air = scene.air
        nodes = scene.start_nodes(self.surface, scene.supports(self.surface))
        drag: dict[str, Any] = {}
        if air is not None:
            drag = {"drag_normal": air.normal, "drag_tangential": air.tangential, "air_velocity": air.velocity}
        self._time = time
        supports = [h.support(self.surface) for h in scene.holds if h.release is None or h.release > time + 1e-12]
        ramp = next((t for t, f in scene.schedule if f == 1.0), 0.1) if scene.schedule else 0.1
        return self._make(
            self.surface,
            scene.fabric,
            supports,
            scene.gravity,
            scene.bodies,
            level.dt,
            level.substeps,
            thickness=scene.contact.distance if scene.bodies or scene.contact.self_contact else 0.0,
            mass_damping=scene.mass_damping,
            self_contact=scene.contact.self_contact,
            bending=scene.bending,
            ramp=ramp,
            start=nodes,
            velocity=scene.velocity,
            **drag,
        )

    @property
    def time(self) -> float:
        """s."""
        return self.model.time

    def advance(self, until: float, report: Report) -> Advance:
        from mfar_fem.solve.position_based import PositionsNotFiniteError

        for stop in [*(t for t in self.scene.releases() if self._time < t < until - 1e-12), until]:
            steps = max(0, round((stop - self.model.time) / self.model.dt))
            try:
                for _ in range(steps):
                    self.model.step()
                    energy = self.model.energies()
                    speed = float(np.sqrt(np.sum(self.model.velocities**2, axis=1).max(initial=0.0)))
                    report(
                        {
                            "time": self.model.time,
                            "dt": self.model.dt,
                            "iterations": self.model.substeps,
                            "kinetic": energy["kinetic"],
                            "membrane": energy["membrane"],
                            "bending": energy["bending"],
                            "potential": energy["gravity"],
                            "speed": speed,
                        }
                    )
            except PositionsNotFiniteError as error:
                return Advance("NotFinite", str(error), self.time)
            if stop in self.scene.releases():
                kept = self.model.state_dict()
                self.model = self._phase(stop)
                self.model.load_state_dict(kept)
        return Advance("converged", "", self.time)

    def nodes(self) -> np.ndarray:
        return self.model.positions.copy()

    def velocities(self) -> np.ndarray:
        return self.model.velocities.copy()

    def fields(self) -> dict[str, np.ndarray]:
        return {}

    def state(self) -> dict[str, np.ndarray]:
        return {k: np.asarray(v) for k, v in self.model.state_dict().items()} | {"phase": np.array(self._time)}

    def restore(self, state: dict[str, np.ndarray]) -> None:
        if float(state["phase"]) != self._time:
            self.model = self._phase(float(state["phase"]))
        self.model.load_state_dict(state)

    def summary(self) -> dict[str, Any]:
        return {
            "unknowns": 3 * len(self.surface.vertices),
            "elements": len(self.surface.triangles),
            "substeps": self.model.substeps,
            "excess_compliance": self.model.excess_compliance,
            "notes": [
                "position-based level: no residual is controlled; the membrane of a step is too soft by the excess compliance"
            ],
        }


def shell_fields(shell, state: State) -> dict[str, np.ndarray]:
    """Fields by triangle: Green strain (warp, weft, shear), membrane and bending energy per area (J/m²)."""
    area = shell.geometry.area_weights
    total = area.sum(axis=1)
    E = np.einsum("eq,eqc->ec", area, shell.green_strain(state)) / total[:, None]
    found = {
        "strain_warp": E[:, 0],
        "strain_weft": E[:, 1],
        "strain_shear": E[:, 2],
        "membrane_energy": np.sum(area * shell.law_response(state, 0)[0], axis=1) / total,
    }
    if shell.with_bending:
        found["bending_energy"] = shell.bending_energy_by_element(state) / total
    return found


def _row(record: StepRecord) -> dict[str, float]:
    return {f.name: value for f in fields(record) if (value := getattr(record, f.name)) is not None}


def engine(scene: Scene) -> Engine:
    """The engine of a scene in time at its level."""
    return PositionLevel(scene) if scene.level.order == 0 else FiniteElements(scene)
