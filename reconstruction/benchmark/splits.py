"""Who is in which split: every identity has its own garment, body and texture, so nothing is shared between splits.

Of every seven identities four train, one validates and two test. The type ``veil-hat`` is held out altogether: it has neither
sleeves nor a torso and only six of the twelve points, so it asks for real extrapolation, while the other three still teach all
twelve. Damage level 3 is drawn for test identities only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mfar_fem.errors import ParameterError

SEEN = ("round-collar-robe", "half-sleeve", "flying-ribbon")
HELD_OUT = "veil-hat"
HELD_OUT_DAMAGE = 3
FOLDS = 5
SPLITS = ("train", "validation", "test", "test-type")
"""``test-type`` holds the identities of the held-out type."""
_OF_SEVEN = ("train", "test", "train", "validation", "train", "test", "train")


@dataclass(frozen=True)
class Identity:
    """A garment on a body with its textures.

    Parameters
    ----------
    name : str
        ``I0007``, or ``H0003`` of the held-out type.
    kind, split : str
    fold : int
        0 to 4 of five folds over the three seen types; -1 for the held-out type.
    garment_seed, body_seed, texture_seed : int
        32-bit.
    """

    name: str
    kind: str
    split: str
    fold: int
    garment_seed: int
    body_seed: int
    texture_seed: int

    @property
    def stem(self) -> str:
        """Folder name and start of its file names: name and seeds in hexadecimal."""
        return f"{self.name}_g{self.garment_seed:08x}_b{self.body_seed:08x}_t{self.texture_seed:08x}"


def identities(count: int, seed: int) -> list[Identity]:
    """The identities of a benchmark.

    Parameters
    ----------
    count : int
        Identities of the three seen types; a seventh more, at least one, of the held-out type is added.
    seed : int
        Of the benchmark. An identity does not depend on `count`, so a benchmark can grow.

    Raises
    ------
    ParameterError
        `count` is not positive, or the seed is negative.
    """
    if count < 1 or seed < 0:
        raise ParameterError(f"identities must be at least 1 and the seed not negative, not {count} and {seed}")
    made, of_kind = [], dict.fromkeys(SEEN, 0)
    for i in range(count):
        kind = SEEN[(i // 7 + i % 7) % len(SEEN)]
        made.append(Identity(f"I{i:04d}", kind, _OF_SEVEN[i % 7], of_kind[kind] % FOLDS, *seeds_of(seed, 0, i)))
        of_kind[kind] += 1
    made += [Identity(f"H{i:04d}", HELD_OUT, "test-type", -1, *seeds_of(seed, 1, i)) for i in range(max(1, round(count / 7)))]
    for field in ("garment_seed", "body_seed", "texture_seed"):
        if len({getattr(i, field) for i in made}) < len(made):
            raise ParameterError(
                f"seed {seed} draws the same {field.replace('_', ' ')} twice for {count} identities; choose another"
            )
    return made


def seeds_of(seed: int, group: int, number: int) -> tuple[int, int, int]:
    """Seeds of garment, body and texture of a number in a group."""
    a, b, c = np.random.SeedSequence([seed, group, number]).generate_state(3)
    return int(a), int(b), int(c)
