"""What a constitutive law is: parameter table, validation, batched response, registry.

A law sees the in-plane right Cauchy–Green tensor of the mid-surface in the warp/weft frame, ``C = [C11, C22, C12]``
(1 = warp, 2 = weft, orthonormal in the reference state), and returns the plane-stress energy density, the second
Piola–Kirchhoff stress ``S = 2 dPsi/dC`` and the tangent ``dS/dE``, ``E = [E11, E22, 2 E12]``.
"""

from __future__ import annotations

import importlib
import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np

from ..errors import InputError, ParameterError, UnknownNameError

#: det C outside this open interval counts as inadmissible (its cubes stay inside the floating-point range).
DET_MIN, DET_MAX = 1e-60, 1e60


@dataclass(frozen=True)
class Parameter:
    """One row of a law's parameter table.

    Attributes
    ----------
    name, symbol : str
        Python name and printed symbol.
    unit : str
        SI unit in a form the ``pint`` library parses; ``"dimensionless"`` for pure numbers.
    default, lower, upper : float
        Default value and closed bounds, in ``unit``.
    scale : str
        ``"log"`` or ``"linear"``: the scale in which a fit moves it.
    description, source : str
        Meaning, and where the definition or the default comes from (with DOI).
    fit : bool
        Whether a fit frees it unless told otherwise (False for what the data cannot separate, or for a mere setting).
    """

    name: str
    symbol: str
    unit: str
    default: float
    lower: float
    upper: float
    scale: str
    description: str
    source: str = ""
    fit: bool = True

    def check(self, value: float, law: str) -> float:
        """Return `value` as a float, or raise ParameterError with the permitted interval."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise ParameterError(f"{law}: {self.name} = {value!r} is not a number (unit {self.unit})") from None
        if not math.isfinite(number):
            raise ParameterError(f"{law}: {self.name} = {number} is not finite (unit {self.unit})")
        if not self.lower <= number <= self.upper:
            raise ParameterError(
                f"{law}: {self.name} = {number:g} is outside its bounds [{self.lower:g}, {self.upper:g}] "
                f"(unit {self.unit}; {self.description})"
            )
        return number


class Law(ABC):
    """A constitutive law: immutable, compared by name and values.

    Parameters
    ----------
    **values : float
        Parameter values by name, SI; missing ones take the default of the table.

    Raises
    ------
    ParameterError
        Unknown name, not a finite number, out of bounds, or a combination the law cannot accept.

    Notes
    -----
    Subclasses define ``name``, ``basis``, ``parameters`` and the response (see :mod:`.invariants` and
    :mod:`.plane_stress` for the two ways to do it from a formula). Where C is inadmissible (det C <= 0, past
    locking) the energy is ``+inf`` and stress and tangent are 0; a NaN is never returned.
    """

    name: ClassVar[str]
    basis: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]

    def __init__(self, **values: float):
        table = {p.name: p for p in self.parameters}
        for name in values:
            if name not in table:
                raise ParameterError(f"{self.name} has no parameter '{name}'; it has: {', '.join(table) or 'none'}")
        checked = {n: p.check(values.get(n, p.default), self.name) for n, p in table.items()}
        object.__setattr__(self, "_values", checked)
        self.validate()

    def validate(self) -> None:  # noqa: B027 (optional hook)
        """Reject combinations of parameters the bounds alone do not exclude (ParameterError)."""

    @property
    def values(self) -> Mapping[str, float]:
        """Read-only view of the parameter values, SI."""
        return MappingProxyType(self._values)

    @property
    def stress_unit(self) -> str:
        """Unit of every stress the law returns: ``Pa`` (basis volume) or ``N/m`` (basis area)."""
        return "Pa" if self.basis == "volume" else "N/m"

    def replace(self, **values: float) -> Law:
        """Return the same law with some values changed."""
        return type(self)(**{**self._values, **values})

    @classmethod
    def parameter(cls, name: str) -> Parameter:
        """Return the table row of a parameter, or raise ParameterError."""
        for p in cls.parameters:
            if p.name == name:
                return p
        known = ", ".join(p.name for p in cls.parameters)
        raise ParameterError(f"{cls.name} has no parameter '{name}'; it has: {known}")

    # -- response ------------------------------------------------------------------------------------------------

    @abstractmethod
    def evaluate(self, C, order: int = 2):
        """Energy, stress and tangent in one pass.

        Parameters
        ----------
        C : (n, 3) array
            ``[C11, C22, C12]`` in the warp/weft frame, dimensionless.
        order : {0, 1, 2}
            0 gives the energy alone, 1 also the stress, 2 also the tangent; what is not asked for is None.

        Returns
        -------
        energy : (n,) array
            J/m^3 or J/m^2 according to ``basis``; ``+inf`` where C is inadmissible.
        stress : (n, 3) array or None
            ``[S11, S22, S12]``, Pa or N/m.
        tangent : (n, 3, 3) array or None
            ``dS_I/dE_J`` with ``E = [E11, E22, 2 E12]``; symmetric.
        """

    @abstractmethod
    def stress_sensitivity(self, C, names: Sequence[str]) -> np.ndarray:
        """Derivative of the stress with respect to parameters, at fixed C.

        Returns
        -------
        (n, 3, len(names)) array
            ``dS_I/dtheta``; 0 where C is inadmissible.
        """

    def energy(self, C) -> np.ndarray:
        """Energy density. *Shape:* (n,)."""
        return self.evaluate(C, 0)[0]

    def stress(self, C) -> np.ndarray:
        """Second Piola–Kirchhoff stress ``[S11, S22, S12]``. *Shape:* (n, 3)."""
        return self.evaluate(C, 1)[1]

    def tangent(self, C) -> np.ndarray:
        """Tangent ``dS_I/dE_J``. *Shape:* (n, 3, 3)."""
        return self.evaluate(C, 2)[2]

    def tangent_at_rest(self) -> np.ndarray:
        """Tangent at C = I. *Shape:* (3, 3)."""
        return self.tangent(np.array([[1.0, 1.0, 0.0]]))[0]

    # -- value semantics -----------------------------------------------------------------------------------------

    def __getattr__(self, name: str) -> Any:
        values = self.__dict__.get("_values", {})
        if name in values:
            return values[name]
        raise AttributeError(f"{type(self).__name__} has no attribute or parameter '{name}'")

    def __setattr__(self, name, value):
        raise AttributeError(f"{type(self).__name__} is immutable; use law.replace({name}=...)")

    def __eq__(self, other):
        return type(other) is type(self) and other._values == self._values

    def __hash__(self):
        return hash((type(self), self.name, tuple(self._values.items())))

    def __repr__(self):
        return f"{type(self).__name__}({', '.join(f'{n}={v:.6g}' for n, v in self._values.items())})"

    _file_spec: ClassVar[str | None] = None  # of a user's class: where other processes find it again

    def __reduce__(self):
        if self._file_spec is not None:
            from .autodiff import reload

            return reload, (self._file_spec, dict(self._values))
        return _rebuild, (type(self), dict(self._values))


def _rebuild(cls, values):
    return cls(**values)


def columns(C) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Split C into contiguous columns and tell where it is admissible (positive definite, finite).

    Parameters
    ----------
    C : (n, 3) array

    Returns
    -------
    C11, C22, C12 : (n,) arrays
        Inadmissible points are replaced by the identity.
    ok : (n,) bool array
    """
    C = np.asarray(C, dtype=float)
    if C.ndim != 2 or C.shape[1] != 3:
        raise InputError(f"C must have shape (n, 3) = [C11, C22, C12], got {C.shape}")
    c11, c22, c12 = np.ascontiguousarray(C.T)
    with np.errstate(invalid="ignore", over="ignore"):
        det = c11 * c22 - c12 * c12
        ok = (det > DET_MIN) & (det < DET_MAX) & (c11 > 0.0)
    if not ok.all():
        c11, c22, c12 = np.where(ok, c11, 1.0), np.where(ok, c22, 1.0), np.where(ok, c12, 0.0)
    return c11, c22, c12, ok


# -- registry ----------------------------------------------------------------------------------------------------

_MODULES = {
    "arruda-boyce": "arruda_boyce:ArrudaBoyce",
    "bischoff": "bischoff:Bischoff",
    "eight-chain-literal": "eight_chain_literal:EightChainLiteral",
    "eight-chain-silk": "eight_chain_silk:EightChainSilk",
    "fung": "fung:Fung",
    "gasser-ogden-holzapfel": "gasser_ogden_holzapfel:GasserOgdenHolzapfel",
    "neo-hookean": "neo_hookean:NeoHookean",
    "neo-hookean-compressible": "neo_hookean:CompressibleNeoHookean",
    "st-venant-kirchhoff": "st_venant_kirchhoff:StVenantKirchhoff",
    "yarn-network": "yarn_network:YarnNetwork",
}
_REGISTERED: dict[str, type[Law]] = {}


def register(cls: type[Law]) -> type[Law]:
    """Class decorator: make a law of your own available to :func:`get_law` under ``cls.name``."""
    _REGISTERED[cls.name] = cls
    return cls


def law_names() -> list[str]:
    """Names of all laws, sorted."""
    return sorted({*_MODULES, *_REGISTERED})


def law_class(name: str) -> type[Law]:
    """Return the class registered under `name`; UnknownNameError lists the names that exist."""
    if name in _REGISTERED:
        return _REGISTERED[name]
    if name not in _MODULES:
        raise UnknownNameError(f"unknown law '{name}'; known laws: {', '.join(law_names())}")
    module, attribute = _MODULES[name].split(":")
    return getattr(importlib.import_module(f".{module}", __package__), attribute)


def get_law(name: str, **values: float) -> Law:
    """Build a law by its registry name.

    Parameters
    ----------
    name : str
        One of :func:`law_names`.
    **values : float
        Parameter values, SI.

    Raises
    ------
    UnknownNameError, ParameterError
    """
    return law_class(name)(**values)
