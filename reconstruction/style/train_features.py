"""Training of the small feature network on drawn scenes, with what it can tell on scenes that it did not see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from reconstruction.landmarks import KINDS
from reconstruction.style.scenes import GARMENTS, draw_scene, random_homography, view
from reconstruction.style.small_features import Heads, SmallNetwork
from reconstruction.torch_library import functional, torch

SIZE = 96
"""Side of the pictures it is trained on, px."""


def examples(seed: int, count: int, size: int = SIZE, progress: Callable[[int], None] | None = None) -> tuple[np.ndarray, dict]:
    """Drawn scenes, one rendering each.

    Returns
    -------
    pictures : (count, size, size, 3) uint8 array
    answers : dict of (count,) int arrays
        By question (see :class:`small_features.Heads`).
    """
    pictures = np.empty((count, size, size, 3), dtype=np.uint8)
    answers = {name: np.empty(count, dtype=np.int64) for name in Heads().items()}
    for k in range(count):
        rng = np.random.default_rng([seed, k])
        scene, kind = draw_scene(rng), int(rng.integers(len(KINDS)))
        pictures[k] = view(scene, KINDS[kind], rng, size, random_homography(rng, size))
        values = {"kind": kind, "garment": GARMENTS.index(scene.garment), "belt": scene.belt, "medallions": scene.medallions}
        for name, value in values.items():
            answers[name][k] = int(value)
        if progress is not None:
            progress(k + 1)
    return pictures, answers


def train(pictures: np.ndarray, answers: dict, epochs: int = 8, batch: int = 32, rate: float = 2e-3, seed: int = 0,
          progress: Callable[[int, float], None] | None = None) -> SmallNetwork:
    """Fit a :class:`SmallNetwork` by the sum of the cross entropies of its questions.

    Parameters
    ----------
    pictures, answers
        See :func:`examples`.
    epochs, batch : int
    rate : float
        Highest of a one-cycle schedule of Adam.
    seed : int
    progress : callable, optional
        ``progress(steps done, loss)``.
    """
    torch.manual_seed(seed)
    network = SmallNetwork()
    steps = epochs * (len(pictures) // batch)
    optimizer = torch.optim.Adam(network.parameters(), rate)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimizer, rate, total_steps=max(steps, 2))
    rng, step = np.random.default_rng(seed), 0
    for _ in range(epochs):
        order = rng.permutation(len(pictures))
        for first in range(0, len(order) - batch + 1, batch):
            chosen = order[first : first + batch]
            answer = network(_batch(pictures[chosen]))
            loss = torch.stack([functional.cross_entropy(answer[n], torch.from_numpy(answers[n][chosen])) for n in answer]).sum()
            optimizer.zero_grad(set_to_none=True)
            loss.backward()
            optimizer.step()
            schedule.step()
            step += 1
            if progress is not None:
                progress(step, loss.item())
    return network.eval()


def accuracy(network: SmallNetwork, pictures: np.ndarray, answers: dict, batch: int = 64) -> dict[str, dict[str, float]]:
    """Share of right answers by question, beside that of always giving the commonest (``chance``)."""
    network.eval()
    right = {name: 0 for name in answers}
    with torch.no_grad():
        for first in range(0, len(pictures), batch):
            answer = network(_batch(pictures[first : first + batch]))
            for name, logits in answer.items():
                right[name] += int((logits.argmax(1).numpy() == answers[name][first : first + batch]).sum())
    return {name: {"right": right[name] / len(pictures), "chance": float(np.bincount(answers[name]).max() / len(pictures))}
            for name in answers}


def _batch(pictures):
    return torch.from_numpy(pictures).permute(0, 3, 1, 2).float().div(255.0).contiguous()
