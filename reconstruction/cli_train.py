"""``mfar train``: the networks of the reconstruction."""

from __future__ import annotations

import typer

from reconstruction.cli_keypoints import train_keypoints
from reconstruction.cli_style import train_style

app = typer.Typer(help="Train the networks of the reconstruction.", no_args_is_help=True)
app.command("keypoints")(train_keypoints)
app.command("style")(train_style)
