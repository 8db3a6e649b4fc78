"""Garments of every type, draped once on a coarse mesh and shared by the tests."""

from functools import cache

import pytest


@cache
def _model(kind):
    from reconstruction.benchmark.identity import model
    from reconstruction.benchmark.splits import Identity

    return model(Identity("I0000", kind, "test", 0, 101, 202, 303), size=0.045)


@pytest.fixture
def model_of():
    """``model_of(kind)``: a draped identity with a mesh of 45 mm."""
    pytest.importorskip("embreex")
    return _model
