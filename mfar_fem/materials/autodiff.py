"""A user's own energy function as a law, differentiated automatically by ``autograd``.

Handy for trying a formula; expect it to be ten to thirty times slower than a law with hand-written derivatives.

>>> import autograd.numpy as anp
>>> from mfar_fem.materials import law_from_energy
>>> def energy(C11, C22, C12, mu):
...     return 0.5 * mu * (C11 + C22 + 1 / (C11 * C22 - C12**2) - 3)
>>> law = law_from_energy(energy, {"mu": 1e5}, basis="volume", name="mine")
>>> law.stress([[1.0, 1.0, 0.0]]).round(6) + 0.0
array([[0., 0., 0.]])
"""

from __future__ import annotations

import hashlib
import importlib.util
import inspect
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError, ParameterError
from .law import Law, Parameter, columns

_D = np.array([2.0, 2.0, 1.0])
_ORDER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))


class EnergyLaw(Law):
    """A law that holds an energy function; made by :func:`law_from_energy` and :func:`law_from_file`."""

    name = "energy"
    basis = "volume"
    parameters: tuple[Parameter, ...] = ()  # type: ignore[misc]

    def __init__(self, func: Callable, parameters, basis: str, name: str, values: Mapping, spec=None):
        object.__setattr__(self, "func", func)
        object.__setattr__(self, "parameters", parameters)
        object.__setattr__(self, "basis", basis)
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "_spec", spec)
        super().__init__(**values)

    def parameter(self, name):
        """Return the table row of a parameter, or raise ParameterError; the table is that of this law, not of the class."""
        for p in self.parameters:
            if p.name == name:
                return p
        known = ", ".join(p.name for p in self.parameters) or "none"
        raise ParameterError(f"{self.name} has no parameter '{name}'; it has: {known}")

    def replace(self, **values):
        """Return the same energy function with some values changed, SI."""
        return EnergyLaw(self.func, self.parameters, self.basis, self.name, {**self._values, **values}, self._spec)

    def __eq__(self, other):
        return isinstance(other, EnergyLaw) and other.func is self.func and other._values == self._values

    __hash__ = Law.__hash__

    def __reduce__(self):
        if self._spec is not None:
            return reload, (self._spec, dict(self._values))
        return EnergyLaw, (self.func, self.parameters, self.basis, self.name, dict(self._values))

    # -- response --------------------------------------------------------------------------------------------------

    def _call(self, *arguments):
        names = [p.name for p in self.parameters]
        return self.func(*arguments[:3], **dict(zip(names, arguments[3:], strict=True)))

    def _arguments(self, C):
        c11, c22, c12, ok = columns(C)
        arguments = [c11, c22, c12] + [np.full(len(ok), v) for v in self._values.values()]
        with np.errstate(all="ignore"):
            energy = np.asarray(self._call(*arguments), dtype=float)
        if energy.shape != ok.shape:
            raise InputError(
                f"{self.name}: the energy function returned shape {energy.shape} for {len(ok)} points; write it with "
                "element-wise operations of autograd.numpy on the arrays C11, C22, C12"
            )
        finite = np.isfinite(energy)
        if not (ok & finite).all():
            ok = ok & finite
            arguments[:3] = [np.where(ok, a, rest) for a, rest in zip(arguments[:3], (1.0, 1.0, 0.0), strict=True)]
        return arguments, np.where(ok, energy, np.inf), ok

    def _derivative(self, *which):
        from autograd import elementwise_grad

        f = self._call
        for i in which:
            f = elementwise_grad(f, i)
        return f

    def evaluate(self, C, order: int = 2):
        """Energy (n,), stress (n, 3) and tangent (n, 3, 3), differentiated automatically; see :meth:`.Law.evaluate`.

        Raises
        ------
        InputError
            The function returns a wrong shape, or ``autograd`` cannot differentiate it.
        """
        arguments, energy, ok = self._arguments(C)
        if order < 1:
            return energy, None, None
        with np.errstate(all="ignore"):
            stress = np.stack([self._run((i,), arguments) for i in range(3)], axis=1) * _D
            stress = np.where(ok[:, None], stress, 0.0)
            if order < 2:
                return energy, stress, None
            tangent = np.zeros((len(ok), 3, 3))
            for i, j in _ORDER:
                tangent[:, i, j] = tangent[:, j, i] = self._run((i, j), arguments)
        tangent *= _D[:, None] * _D
        return energy, stress, np.where(ok[:, None, None], tangent, 0.0)

    def stress_sensitivity(self, C, names: Sequence[str]):
        """``dS_I/dtheta`` by automatic differentiation, (n, 3, len(names)); raises as :meth:`evaluate` does."""
        arguments, _, ok = self._arguments(C)
        out = np.zeros((len(ok), 3, len(names)))
        position = {row.name: 3 + i for i, row in enumerate(self.parameters)}
        for p, name in enumerate(names):
            self.parameter(name)
            with np.errstate(all="ignore"):
                for i in range(3):
                    out[:, i, p] = self._run((i, position[name]), arguments) * _D[i]
        out[~ok] = 0.0
        return out

    def _run(self, which, arguments):
        import warnings

        try:
            with warnings.catch_warnings():
                # autograd warns when an argument does not enter; the derivative is then rightly zero
                warnings.filterwarnings("ignore", message="Output seems independent of input")
                value = self._derivative(*which)(*arguments)
        except (TypeError, ValueError, AttributeError, NotImplementedError) as error:
            raise InputError(
                f"{self.name}: the energy cannot be differentiated ({type(error).__name__}: {error}); use functions of "
                "autograd.numpy instead of numpy or math, and no assignment into arrays"
            ) from error
        return np.broadcast_to(np.asarray(value, dtype=float), arguments[0].shape)


def law_from_energy(
    func: Callable,
    parameters: Sequence[Parameter] | Mapping[str, float] | None = None,
    basis: str = "volume",
    name: str | None = None,
    **values: float,
) -> EnergyLaw:
    """Make a law of an energy function.

    Parameters
    ----------
    func : callable
        ``func(C11, C22, C12, **parameters) -> energy``, element-wise on (n,) arrays, written with
        ``autograd.numpy``. It may return ``inf`` or NaN where the state is inadmissible.
    parameters : sequence of Parameter, or mapping name -> default, optional
        Parameter table; from the defaults of the function's further arguments if omitted. A plain positive default
        is taken on a log scale without effective bounds, any other on a linear one.
    basis : {"volume", "area"}
        Energy in J/m^3 or in J/m^2.
    name : str, optional
        Name of the law; that of the function if omitted.
    **values : float
        Parameter values that differ from the defaults.

    Raises
    ------
    InputError
        `func` does not have the right signature, or `basis` is unknown.
    """
    return _build(func, parameters, basis, name, values)


def _user_module(file: Path):
    """The user's file as a module, run once for each content; its name is the same in every process."""
    key = hashlib.sha256(str(file.resolve()).encode() + b"\0" + file.read_bytes()).hexdigest()[:16]
    module_name = f"_mfar_user_{file.stem}_{key}"
    if module_name in sys.modules:
        return sys.modules[module_name]
    module_spec = importlib.util.spec_from_file_location(module_name, file)
    if module_spec is None or module_spec.loader is None:
        raise InputError(f"'{file}' is not a Python file")
    module = importlib.util.module_from_spec(module_spec)
    sys.modules[module_name] = module
    try:
        module_spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[module_name]
        raise InputError(f"'{file}' cannot be run: {type(error).__name__}: {error}") from error
    return module


def law_from_file(spec: str, **values: float) -> Law:
    """Load a law from ``path.py:name``.

    `name` may be a :class:`Law` subclass, a law, or an energy function as for :func:`law_from_energy`; a function may
    carry its table in attributes ``parameters``, ``basis`` and ``law_name``.

    Raises
    ------
    InputError
        No such file or name, the file fails to run, or the object is none of the three.
    """
    path, _, name = spec.rpartition(":")
    if not path or not name:
        raise InputError(f"'{spec}' is not of the form path.py:name")
    file = Path(path)
    if not file.is_file():
        raise InputError(f"'{path}' does not exist; give path.py:name (a Law class, a law or an energy function)")
    module = _user_module(file)
    if not hasattr(module, name):
        public = sorted(n for n, v in vars(module).items() if callable(v) and not n.startswith("_"))
        raise InputError(f"'{path}' defines no '{name}'; it defines: {', '.join(public) or 'nothing callable'}")
    found, where = getattr(module, name), f"{file.resolve()}:{name}"
    if isinstance(found, EnergyLaw):
        spec_of = found._spec or where
        return EnergyLaw(found.func, found.parameters, found.basis, found.name, {**found.values, **values}, spec_of)
    if isinstance(found, Law):
        type(found)._file_spec = where
        return found.replace(**values) if values else found
    if inspect.isclass(found) and issubclass(found, Law):
        found._file_spec = where
        return found(**values)
    if callable(found) and not inspect.isclass(found):
        table, basis = getattr(found, "parameters", None), getattr(found, "basis", "volume")
        return _build(found, table, basis, getattr(found, "law_name", name), values, where)
    raise InputError(f"'{spec}' is a {type(found).__name__}; expected a Law class, a law or an energy function")


def _build(func, parameters, basis, name, values, spec=None):
    label = name or getattr(func, "__name__", "energy")
    if basis not in ("volume", "area"):
        raise InputError(f"{label}: basis '{basis}' is unknown; 'volume' (J/m^3) or 'area' (J/m^2)")
    arguments = list(inspect.signature(func).parameters.values())
    free = any(a.kind is inspect.Parameter.VAR_KEYWORD for a in arguments)
    named = [a for a in arguments if a.kind is not inspect.Parameter.VAR_KEYWORD]
    if len(named) < 3:
        raise InputError(f"{label}: the function must begin with C11, C22, C12; it takes {[a.name for a in named]}")
    if parameters is None:
        missing = [a.name for a in named[3:] if a.default is inspect.Parameter.empty]
        if missing:
            raise InputError(f"{label}: no default for {', '.join(missing)}; give `parameters` or defaults")
        parameters = {a.name: a.default for a in named[3:]}
    if isinstance(parameters, Mapping):
        unit = "Pa" if basis == "volume" else "N/m"
        parameters = [_plain(n, float(v), unit) for n, v in parameters.items()]
    table = tuple(parameters)
    extra = [p.name for p in table if p.name not in {a.name for a in named[3:]}]
    if extra and not free:
        raise InputError(f"{label}: the function takes no argument named {', '.join(extra)}")
    lacking = {a.name for a in named[3:] if a.default is inspect.Parameter.empty} - {p.name for p in table}
    if lacking:
        raise InputError(f"{label}: the table lacks {', '.join(sorted(lacking))}, which the function needs")
    return EnergyLaw(func, table, basis, label, values, spec)


def _plain(name, default, unit):
    text = f"given as a number; unit {unit} or a pure number"
    if default > 0.0:
        return Parameter(name, name, "dimensionless", default, 1e-30, 1e30, "log", text)
    return Parameter(name, name, "dimensionless", default, -1e30, 1e30, "linear", text)


def reload(spec, values):
    return law_from_file(spec, **values)
