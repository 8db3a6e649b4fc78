"""Entry point of the command line ``mfar``.

The command groups are entry points of the group ``mfar.commands`` (any installed package may add one); a group is
imported only when one of its commands is called, so that ``mfar --help`` stays quick.
"""

from __future__ import annotations

import importlib.metadata
import logging
import sys
import traceback
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from mfar_fem import __version__
from mfar_fem.cli import console
from mfar_fem.errors import MfarError, MissingDependencyError

ENTRY_POINT_GROUP = "mfar.commands"

# One line each for `mfar --help`, known without importing the group; also the order in which they are listed.
SHORT_HELP = {
    "materials": "Constitutive laws: list them, plot one, check one (also your own).",
    "fabrics": "Fabric presets and fabric files: list them, show every number with its source.",
    "test": "Virtual textile tests: strip, cantilever, drape, swing, shear, wrinkles, inflation.",
    "calibrate": "Fit laws to measured curves by inverse finite elements and write a report.",
    "validate": "Compare a fabric's prediction with measured curves, without fitting.",
    "plan": "Say what a scene computes and why, and what it will take, before it runs.",
    "simulate": "Run a scene file: motion in time, contact, drape; survives a kill.",
    "tradeoff": "Time, memory and error of a scene at every level, with a recommendation.",
    "benchmark": "Shell benchmarks with exact or published references, and timings.",
    "stress-test": "Random extreme cases: each converges and is verified, or fails by name; never NaN, never a hang.",
    "study": "Longer studies: synthetic round trip, every law on the cupro curves, sensitivities.",
    "mesh": "Triangle meshes: check one, convert it, make strips, discs and annuli.",
    "fuse": "Images of sources: check them, correct the light, match every pair, measure and vote.",
    "keypoints": "Find the twelve structural points of the garment in images.",
    "template": "Cutting template of a straight-cut garment from keypoints: SVG, DXF, JSON at true scale.",
    "restore": "From pictures with cameras to a garment on a figure, settled by the solver, and its report.",
    "style": "Give images the colours and textures of another source.",
    "benchmark-data": "Make the synthetic benchmark: garments, bodies, images in three styles, and the truth.",
    "benchmark-case": "Make ten pictures of one synthetic garment as a folder of sources, with the truth apart.",
    "train": "Train the networks of the reconstruction: keypoints, style.",
}

# The click that this typer is built on (its own copy in recent versions).
ClickException: Any = next(base for base in typer.BadParameter.__mro__ if base.__name__ == "ClickException")


def command_entry_points() -> dict[str, importlib.metadata.EntryPoint]:
    """Entry points of all installed command groups by name, the project's own first, then others by name."""
    found = {point.name: point for point in importlib.metadata.entry_points(group=ENTRY_POINT_GROUP)}
    order = [name for name in SHORT_HELP if name in found]
    return {name: found[name] for name in order + sorted(set(found) - set(order))}


def load_command(point: importlib.metadata.EntryPoint):
    """Import a command group (a ``typer.Typer``) or a plain command function and return it as a command.

    Other packages add commands to a group of that name by entry points of ``mfar.commands.NAME``.

    Raises
    ------
    MissingDependencyError
        The module, or something it needs, cannot be imported.
    """
    try:
        target = point.load()
        more = {found.name: found.load() for found in importlib.metadata.entry_points(group=f"{ENTRY_POINT_GROUP}.{point.name}")}
    except (ImportError, AttributeError) as error:
        raise MissingDependencyError(
            f"the command '{point.name}' ({point.value}) cannot be loaded: {error}; "
            "reinstall the project with `pip install .` or install what is missing"
        ) from error
    if not isinstance(target, typer.Typer):
        function, target = target, typer.Typer(add_completion=False)
        target.command(point.name)(function)
    for name, function in more.items():
        target.command(name)(function)
    target._add_completion = False
    command = typer.main.get_command(target)
    command.name = point.name
    return command


class LazyCommand(TyperCommand):
    """A stand-in that knows its one line of help, and becomes the real command when it is called."""

    def __init__(self, point: importlib.metadata.EntryPoint):
        text = SHORT_HELP.get(point.name, f"Commands of {point.module}.")
        super().__init__(name=point.name, help=text, short_help=text)
        self.point = point

    def make_context(self, info_name, args, parent=None, **extra):
        """Load the command and let it parse its own arguments."""
        return load_command(self.point).make_context(info_name, args, parent=parent, **extra)


class LazyGroup(TyperGroup):
    """The top level: its commands are the entry points, wrapped in :class:`LazyCommand`."""

    def __init__(self, **settings: Any):
        super().__init__(**settings)
        for name, point in command_entry_points().items():
            self.add_command(LazyCommand(point), name)

    def invoke(self, ctx) -> None:
        """Run the command; what it returns is dropped."""
        super().invoke(ctx)  # what a command returns is not an exit code


app = typer.Typer(
    cls=LazyGroup,
    no_args_is_help=True,
    help="Mechanics of silk: hyperelastic laws on a thin-shell FEM, virtual textile tests and inverse calibration.",
    epilog="Exit codes: 0 done, 2 bad input, 3 did not converge (the partial result is written).",
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _show_version(wanted: bool) -> None:
    if wanted:
        sys.stdout.write(f"mfar {__version__}\n")
        raise typer.Exit()


@app.callback()
def _root(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and leave.")
    ] = False,
    verbose: Annotated[int, typer.Option("--verbose", "-v", count=True, help="Log more (-v, -vv) on stderr.")] = 0,
) -> None:
    level = {0: logging.WARNING, 1: logging.INFO}.get(verbose, logging.DEBUG)
    logging.basicConfig(level=logging.WARNING, format="%(levelname)s %(name)s: %(message)s", stream=sys.stderr)
    for package in ("mfar_fem", "material_tests", "calibration", "reconstruction"):
        logging.getLogger(package).setLevel(level)


def main(args: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    args : sequence of str, optional
        Arguments without the program name; those of the process by default.

    Returns
    -------
    int
        0 done, 1 an unexpected error (with its traceback on stderr), 2 bad input, 3 not converged, 130 interrupted.
        With ``--json`` an error is one JSON object ``{"error": {...}}`` on standard output as well, unless the
        command had already written its (partial) result.
    """
    args = list(sys.argv[1:] if args is None else args)
    as_json = "--json" in args
    console.forget_emitted()
    try:
        code = typer.main.get_command(app).main(args=args, prog_name="mfar", standalone_mode=False)
    except MfarError as error:
        console.remove_empty()
        console.report_error(error, error.exit_code, as_json)
        return error.exit_code
    except ClickException as error:
        return _usage_error(error, as_json)
    except (KeyboardInterrupt, typer.Abort):
        code = 130
    except Exception as error:
        console.report_error(error, 1, as_json, title="unexpected error (a defect: please report it)")
        traceback.print_exc()
        return 1
    if code == 130:
        console.report_error(KeyboardInterrupt("interrupted"), 130, as_json, title="stopped")
    return int(code or 0)


def _usage_error(error, as_json: bool) -> int:
    """Show a wrong option or argument the way typer does; no arguments at all just shows the help."""
    if type(error).__name__ == "NoArgsIsHelpError":
        return 0 if getattr(error, "exit_code", 2) == 0 else 2
    from typer import rich_utils

    rich_utils.rich_format_error(error)
    if as_json:
        message = error.format_message()
        console.emit({"error": {"type": "UsageError", "message": message, "exit_code": error.exit_code}}, True)
    return error.exit_code


if __name__ == "__main__":
    sys.exit(main())
