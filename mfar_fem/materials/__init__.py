"""Constitutive laws of the sheet: energy, stress, tangent and parameter sensitivities, batched.

>>> from mfar_fem.materials import get_law
>>> get_law("eight-chain-silk", mu=90e3).values["nu"]
5.2
"""

from __future__ import annotations

from importlib import import_module

from .law import Law, Parameter, get_law, law_class, law_names, register

_LAZY = {
    "ArrudaBoyce": "arruda_boyce",
    "Bending": "bending",
    "Bischoff": "bischoff",
    "CompressibleNeoHookean": "neo_hookean",
    "EightChainLiteral": "eight_chain_literal",
    "EightChainSilk": "eight_chain_silk",
    "Fabric": "fabric",
    "Fung": "fung",
    "GasserOgdenHolzapfel": "gasser_ogden_holzapfel",
    "NeoHookean": "neo_hookean",
    "StVenantKirchhoff": "st_venant_kirchhoff",
    "YarnNetwork": "yarn_network",
    "fabric_names": "fabric",
    "law_from_energy": "autodiff",
    "law_from_file": "autodiff",
}

__all__ = ["Law", "Parameter", "get_law", "law_class", "law_names", "register", *sorted(_LAZY)]


def __getattr__(name: str):
    if name in _LAZY:
        return getattr(import_module(f".{_LAZY[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
