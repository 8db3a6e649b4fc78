"""``mfar style``, ``mfar train style`` and ``mfar study style``."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, jsonable, progress
from mfar_fem.errors import InputError, ParameterError

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
Features = Annotated[
    str, typer.Option(help="Perceptual features: small[=FILE], efficientnet-lite0, vgg16=FILE or vgg19=FILE.")
]
_SHOWN = ("colour", "texture", "network", "ssim", "edge", "gradient", "matches", "correct", "precision", "registered")


def style(
    image: Annotated[Path, typer.Argument(help="Picture B, whose look is changed.")],
    like: Annotated[Path, typer.Option("--like", "-l", help="Picture A, whose look is wanted.")],
    method: Annotated[str, typer.Option("--method", "-m", help="monge-kantorovich, reinhard, sliced, histogram or network.")]
    = "monge-kantorovich",
    weights: Annotated[str, typer.Option(help="Weights of the network; the shipped ones by default.")] = "shipped",
    strength: Annotated[float, typer.Option(min=0.0, max=1.0, help="Part of the way (network only).")] = 1.0,
    out: Annotated[Path, typer.Option("--out", "-o", help="PNG to write.")] = Path("aligned.png"),
    as_json: Json = False,
) -> None:
    """Give one picture the look of another and say what that did to look and structure."""
    from PIL import Image

    from reconstruction import images
    from reconstruction.style.colour_transfer import transfer
    from reconstruction.style.structure import gradient_correlation, ssim
    from reconstruction.style.style_distance import colour_distance, texture_distance

    if out.suffix.lower() != ".png":
        raise InputError(f"--out must be a .png file, not '{out}'")
    check_writable(out.parent)
    b, a = images.load(image), images.load(like)
    if method == "network":
        from reconstruction.style.align import Aligner

        made = Aligner.load(weights).align(b.rgb, a.rgb, strength)
    else:
        made = transfer(method, b.rgb, a.rgb)
    Image.fromarray(made).save(out)
    payload = {
        "image": image, "like": like, "method": method, "out": out, "notes": [*b.notes, *a.notes],
        "colour_before": colour_distance(a.rgb, b.rgb), "colour_after": colour_distance(a.rgb, made),
        "texture_before": texture_distance(a.rgb, b.rgb), "texture_after": texture_distance(a.rgb, made),
        "ssim": ssim(b.rgb, made), "gradient_correlation": gradient_correlation(b.rgb, made),
    }
    emit(payload, as_json, lambda p: (
        f"{p['out']}: colour distance {p['colour_before']:.1f} -> {p['colour_after']:.1f}, texture distance "
        f"{p['texture_before']:.2f} -> {p['texture_after']:.2f}; kept of B: SSIM {p['ssim']:.2f}, "
        f"gradients {p['gradient_correlation']:.2f}"
    ))


def train_style(
    data: Annotated[Path | None, typer.Option(help="CSV (path, kind, subject) or a benchmark; else drawn scenes.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of checkpoint, log, sheets and weights.")] = Path("out/style"),
    loss: Annotated[str, typer.Option(help="usable, or literal: formula (4) as printed.")] = "usable",
    registered: Annotated[bool, typer.Option("--registered", help="Pairs from one window of pictures of one subject.")] = False,
    features: Features = "small",
    layer: Annotated[list[str] | None, typer.Option(help="Layer of the set C (repeatable); each network has its default.")] = None,
    encoder: Annotated[str, typer.Option(help="small, or resnet50=FILE with torchvision's published weights.")] = "small",
    skips: Annotated[bool, typer.Option("--skips/--plain", help="U-shaped, or plain decoder.")] = True,
    statistics: Annotated[str, typer.Option(help="What look is for the usable loss: moments or gram.")] = "moments",
    steps: Annotated[int, typer.Option(min=1, help="Steps in all, those of a continued run included.")] = 400,
    batch: Annotated[int, typer.Option(min=1, help="Pairs a step.")] = 4,
    seed: Annotated[int, typer.Option(help="Of weights and pairs.")] = 0,
    scenes: Annotated[int, typer.Option(min=2, help="Drawn scenes, if no data are given.")] = 40,
    features_only: Annotated[bool, typer.Option("--features-only", help="Train the small feature network instead.")] = False,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="Go on from the folder's checkpoint.")] = True,
    as_json: Json = False,
) -> None:
    """Train the style alignment network (or, with --features-only, the small feature network of its loss)."""
    folder = check_writable(out)
    if features_only:
        emit(_train_features(folder, steps, batch, seed), as_json, lambda p: json.dumps(jsonable(p), indent=2))
        return
    from reconstruction.style.data import drawn_pool, from_benchmark, load_pool, read_list
    from reconstruction.style.train import Settings, Trainer

    kind, _, path = encoder.partition("=")
    settings = Settings(loss=loss, registered=registered, features=features, layers=tuple(layer) if layer else None, encoder=kind,
                        skips=skips, encoder_weights=path or None, statistics=statistics, steps=steps, batch=batch, seed=seed)
    pool = drawn_pool(1, scenes) if data is None else load_pool(from_benchmark(data) if data.is_dir() else read_list(data))
    trainer = Trainer(settings, pool, folder, resume)
    with progress("style", total=steps, quiet=as_json) as advance:
        report = trainer.run(progress=lambda step, values: advance(0, f"style, loss {values['loss']:.3g}", completed=step))
    emit(report, as_json, lambda p: f"{p['weights']}: {p['parameters']:,} parameters, {p['steps']} steps in {p['seconds']:.0f} s")


def study_style(
    scenes: Annotated[int, typer.Option(min=2, help="Drawn scenes that are judged; six pairs each.")] = 12,
    steps: Annotated[int, typer.Option(min=1, help="Steps of each training.")] = 200,
    training_scenes: Annotated[int, typer.Option(min=2, help="Drawn scenes that are trained on.")] = 40,
    features: Features = "small",
    train: Annotated[bool, typer.Option("--train/--no-train", help="Train the three networks; else judge --weights alone.")] = True,
    weights: Annotated[list[str] | None, typer.Option(help="NAME=FILE of a trained network (repeatable); 'shipped' works.")] = None,
    size: Annotated[int, typer.Option(min=64, help="Side of the pictures that are judged, px.")] = 256,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-style"),
    as_json: Json = False,
) -> None:
    """Compare no alignment, colour transfers and networks: look, structure kept, right matches across kinds."""
    folder = check_writable(out)
    from reconstruction.style.study_run import run

    given = {}
    for text in weights or ():
        name, separator, file = text.partition("=")
        if not separator and name != "shipped":
            raise ParameterError(f"--weights takes NAME=FILE or 'shipped', not '{text}'")
        given[name] = file or "shipped"
    began = time.perf_counter()
    with progress("style", quiet=as_json) as advance:
        payload = run(folder, scenes, steps, training_scenes, features, given, train, size,
                      lambda what, done, of: advance(0, what, completed=done, total=of))
    payload["seconds"] = time.perf_counter() - began
    (folder / "study.json").write_text(json.dumps(jsonable(payload), indent=2) + "\n", encoding="utf-8")
    emit(payload, as_json, _show_study)


def _train_features(folder: Path, steps: int, batch: int, seed: int) -> dict[str, Any]:
    from reconstruction.style.small_features import save_small_features
    from reconstruction.style.train_features import accuracy, examples, train

    count, batch = 1000, max(batch, 16)
    epochs = max(1, round(steps / (count // batch)))
    with progress("drawing", total=count + 300) as advance:
        pictures, answers = examples(seed + 10, count, progress=lambda k: advance(1))
        held = examples(seed + 800_000, 300, progress=lambda k: advance(1))
    with progress("features", total=epochs * (count // batch)) as advance:
        network = train(pictures, answers, epochs, batch, seed=seed, progress=lambda step, loss: advance(0, completed=step))
    path = folder / "small_features.pt"
    save_small_features(network, path)
    return {"weights": path, "pictures": count, "epochs": epochs, "held_out": accuracy(network, *held)}


def _show_study(payload) -> list:
    from rich.table import Table

    table = Table("method", *_SHOWN, title=f"{payload['pairs']} pairs across kinds, {payload['scenes']} scenes; mean [95 %]")
    for method, row in payload["table"].items():
        table.add_row(method, *(f"{row[k]['value']:.2f}\n[{row[k]['low']:.2f}, {row[k]['high']:.2f}]" for k in _SHOWN))
    return [table, *payload["verdict"], *payload["notes"]]
