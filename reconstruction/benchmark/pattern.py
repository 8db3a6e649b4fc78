"""Dye and weave patterns as functions of panel coordinates: motif, repeat, palette."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOTIFS = ("medallion", "lozenge", "florets", "stripes", "plain")
_GROUNDS = (
    (164, 52, 40),
    (196, 118, 44),
    (58, 92, 78),
    (48, 70, 116),
    (120, 66, 84),
    (206, 176, 122),
    (92, 110, 58),
    (150, 88, 56),
)
_FIGURES = ((226, 204, 150), (208, 156, 66), (236, 226, 204), (96, 134, 112), (70, 96, 140), (176, 70, 50), (60, 46, 44))


@dataclass(frozen=True)
class Pattern:
    """A repeat pattern.

    Parameters
    ----------
    motif : str
        One of :data:`MOTIFS`.
    warp_repeat, weft_repeat : float
        m; the longest warp repeat drawn is that of the medallion robe, 0.55 m (UNESCO Silk Roads Programme).
    ground, figure, accent, trim : tuple of 3 floats
        Colours, 0 to 1.
    trim_width : float
        Border along collar, cuffs and hem, m.
    """

    motif: str
    warp_repeat: float
    weft_repeat: float
    ground: tuple[float, ...]
    figure: tuple[float, ...]
    accent: tuple[float, ...]
    trim: tuple[float, ...]
    trim_width: float


def draw_pattern(seed: int) -> Pattern:
    """Draw a pattern; ranges other than the longest repeat are assumptions."""
    rng = np.random.default_rng([seed, 53])
    motif = MOTIFS[int(rng.integers(len(MOTIFS)))]
    warp = float(rng.uniform(0.28, 0.55) if motif == "medallion" else rng.uniform(0.06, 0.2))
    ground = np.array(_GROUNDS[int(rng.integers(len(_GROUNDS)))]) / 255
    picks = rng.permutation(len(_FIGURES))[:3]
    figure, accent, trim = (np.array(_FIGURES[int(i)]) / 255 for i in picks)
    jitter = lambda c: tuple(float(x) for x in np.clip(c * rng.uniform(0.85, 1.12) + rng.normal(0, 0.02, 3), 0.02, 0.98))  # noqa: E731
    return Pattern(
        motif,
        warp,
        warp * float(rng.uniform(0.7, 1.1)),
        jitter(ground),
        jitter(figure),
        jitter(accent),
        jitter(trim),
        float(rng.uniform(0.018, 0.05)),
    )


def colour(pattern: Pattern, uv: np.ndarray, trim: np.ndarray) -> np.ndarray:
    """Colour of the cloth.

    Parameters
    ----------
    pattern : Pattern
    uv : (n, 2) array
        Panel coordinates, m.
    trim : (n,) array
        Distance from the nearest open edge, m.

    Returns
    -------
    (n, 3) array
        0 to 1.
    """
    ground, figure, accent, border = (np.array(c) for c in (pattern.ground, pattern.figure, pattern.accent, pattern.trim))
    u = uv[:, 0] / pattern.weft_repeat
    v = uv[:, 1] / pattern.warp_repeat
    out = np.broadcast_to(ground, (len(uv), 3)).copy()
    if pattern.motif == "stripes":
        out[u % 1.0 < 0.4] = figure
        out[np.abs(u % 1.0 - 0.7) < 0.06] = accent
    elif pattern.motif == "lozenge":
        d = np.abs(u % 1.0 - 0.5) + np.abs(v % 1.0 - 0.5)
        out[np.abs(d - 0.5) < 0.05] = figure
        out[d < 0.13] = accent
    elif pattern.motif in ("medallion", "florets"):
        row = np.floor(v)
        x, y = (u + 0.5 * (row % 2)) % 1.0 - 0.5, v % 1.0 - 0.5
        x = x * pattern.weft_repeat / pattern.warp_repeat  # round in metres
        r, a = np.hypot(x, y), np.arctan2(y, x)
        size = 0.32 if pattern.motif == "medallion" else 0.24
        out[r < size * (0.55 + 0.18 * np.cos(6 * a))] = figure
        out[r < size * (0.24 + 0.08 * np.cos(6 * a + np.pi))] = accent
        if pattern.motif == "medallion":
            ring = np.abs(r - size * 1.08) < size * 0.17
            out[ring] = accent
            out[ring & (np.hypot(r - size * 1.08, (((a * 20 / (2 * np.pi)) % 1.0) - 0.5) * size * 0.34) < size * 0.1)] = figure
            corner = np.hypot(np.abs(x) - 0.5 * pattern.weft_repeat / pattern.warp_repeat, np.abs(y) - 0.5)
            out[corner < 0.1] = figure
    out[trim < pattern.trim_width] = border
    out[np.abs(trim - pattern.trim_width) < 0.004] = 0.35 * border
    return out
