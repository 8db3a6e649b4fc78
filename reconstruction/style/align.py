"""The trained network in use: one picture of any size given the look of another."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from mfar_fem.errors import DataFileError, ParameterError
from reconstruction.style.generator import Generator
from reconstruction.style.published import load_published
from reconstruction.torch_library import functional, torch

SHIPPED = Path(__file__).parent / "weights" / "aligner.pt"
FORMAT = "mfar-style-aligner-1"


@dataclass(frozen=True, eq=False)
class Aligner:
    """A generator in evaluation mode.

    Attributes
    ----------
    generator : Generator
    about : dict
        Settings of its training.
    """

    generator: Generator
    about: dict[str, Any] = field(default_factory=dict)

    @classmethod
    def load(cls, path="shipped") -> Aligner:
        """From a file of :func:`save_aligner`; "shipped" is the one that comes with the package.

        Raises
        ------
        DataFileError
            No such file, or not of this format.
        """
        path = SHIPPED if str(path) == "shipped" else Path(path)
        if not path.is_file():
            raise DataFileError("there is no such file of weights; train one with `mfar train style`", path=path)
        try:
            about = torch.load(path, map_location="cpu", weights_only=True)["about"]
            if about["format"] != FORMAT:
                raise KeyError("format")
        except Exception as error:  # torch raises pickle, zip, EOF and runtime errors of its own
            raise DataFileError(f"is not a file of weights of the format {FORMAT}, as `mfar train style` writes it",
                                path=path) from error
        generator = Generator(about["encoder"], about["skips"])
        load_published(generator, path)
        return cls(generator.eval(), about)

    def align(self, image: np.ndarray, like: np.ndarray, strength: float = 1.0) -> np.ndarray:
        """I_B^syn.

        Parameters
        ----------
        image, like : (h, w, 3) uint8 arrays
            I_B, and I_A whose look is wanted; sizes may differ, scales in pixels per figure should not by much.
        strength : float
            Part of the way, 0 to 1.

        Returns
        -------
        (h, w, 3) uint8 array
            Of the size of `image`.
        """
        least = 2 * self.generator.multiple
        for name, picture in (("image", image), ("like", like)):
            if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.uint8 or min(picture.shape[:2]) < least:
                raise ParameterError(f"{name} must be an RGB picture of 8 bits of at least {least} px a side, "
                                     f"not {picture.shape} {picture.dtype}")
        height, width = image.shape[:2]
        with torch.no_grad():
            made = self.generator(self._tensor(like), self._tensor(image), strength)
        values = made[0, :, :height, :width].permute(1, 2, 0).numpy()
        return np.rint(255.0 * values).astype(np.uint8)

    def _tensor(self, picture: np.ndarray):
        """Batch of one, extended by reflection at the right and the bottom to a multiple of the generator's."""
        batch = torch.from_numpy(np.array(picture)).permute(2, 0, 1)[None].float().div(255.0)
        height, width = batch.shape[2:]
        pad = (-width % self.generator.multiple, -height % self.generator.multiple)
        return functional.pad(batch, (0, pad[0], 0, pad[1]), mode="reflect") if any(pad) else batch


def save_aligner(state: dict, encoder: str, skips: bool, path, about: dict | None = None) -> None:
    """Write the weights of a generator in half precision, with what is needed to build it and how it was trained."""
    halves = {name: value.half() if value.is_floating_point() else value for name, value in state.items()}
    plain = {k: v for k, v in (about or {}).items() if k != "encoder_weights"}
    torch.save({"state_dict": halves, "about": {**plain, "format": FORMAT, "encoder": encoder, "skips": skips}}, path)
