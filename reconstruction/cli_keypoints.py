"""``mfar keypoints``, ``mfar train keypoints``, ``mfar study keypoints`` and ``mfar study detector``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from mfar_fem.cli.console import check_writable, emit, progress
from mfar_fem.errors import InputError

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object on stdout and nothing else there.")]
Data = Annotated[Path, typer.Option("--data", "-d", help="Folder of `mfar benchmark-data`, or with a samples.json.")]
Arch = Annotated[str, typer.Option("--arch", help="Network: tiny, small, w18, w32 or w48.")]
Epochs = Annotated[int, typer.Option(min=1, help="Passes over the training images; the rate drops at 2/3 and 5/6 of them.")]
Batch = Annotated[int, typer.Option("--batch", min=2, help="Images a step.")]
Rate = Annotated[float, typer.Option("--rate", help="Learning rate of Adam at the beginning.")]
Sigma = Annotated[float, typer.Option(help="Of the heat maps, heat-map pixels (a quarter of the input's resolution).")]
Weight = Annotated[float, typer.Option("--lambda", help="Weight of the knowledge term.")]
Precision = Annotated[str, typer.Option(help="float32, bfloat16, or auto: what the processor computes faster.")]
Threads = Annotated[int, typer.Option(min=0, help="Of torch; 0: its default. One is faster on a busy machine.")]
Budget = Annotated[float, typer.Option("--max-minutes", min=0.0, help="End a run after this time; 0: never.")]
Graph = Annotated[Path | None, typer.Option("--knowledge", help="Knowledge graph (Turtle); the shipped one by default.")]
Changes = Annotated[str, typer.Option("--augmentation", help="Of training images: paper, or wide (size, place, colour too).")]
Seed = Annotated[int, typer.Option(help="Of the weights, the order and the augmentation.")]


def keypoints(
    images: Annotated[list[Path], typer.Argument(help="Pictures, or one folder with a sources.toml.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/keypoints"),
    weights: Annotated[str, typer.Option(help="A detector of `mfar train keypoints` instead of the shipped one.")] = "shipped",
    kind: Annotated[str, typer.Option(help="Kind of the pictures without sources.toml: mural, figurine or textile.")] = "mural",
    figure: Annotated[str | None, typer.Option(help="Figure on the pictures without sources.toml, male or female: its stature \
sets the scale.")] = None,
    garment: Annotated[str | None, typer.Option("--type", help="Type of the garment, for the template: round-collar-robe, \
half-sleeve, flying-ribbon, veil-hat.")] = None,
    least: Annotated[float, typer.Option(min=0.0, max=1.0, help="Points less likely than this to exist are left out.")] = 0.5,
    flip: Annotated[bool, typer.Option("--flip/--no-flip", help="Look at the mirrored picture too: twice the time.")] = True,
    heatmaps: Annotated[bool, typer.Option("--heatmaps", help="Also draw the twelve heat maps of every picture.")] = False,
    as_json: Json = False,
) -> None:
    """Find the twelve points in pictures; writes keypoints.json and predictions.png."""
    from reconstruction.keypoints.locate import locate

    with progress("keypoints", quiet=as_json) as advance:
        payload = locate(images, out, weights, kind=kind, figure=figure, least=least, flip=flip, heatmaps=heatmaps, garment=garment,
                         progress=advance)
    emit(payload, as_json, _show_points)


def train_keypoints(
    data: Data,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder: detector.pt, checkpoint.pt, log.csv, pictures.")],
    arch: Arch = "small",
    epochs: Epochs = 120,
    batch: Batch = 32,
    rate: Rate = 1e-4,
    sigma: Sigma = 3.0,
    arm: Annotated[str, typer.Option(help="Knowledge term: graph, none, shuffled, literal, graph-pixels.")] = "graph",
    weight: Weight = 0.8,
    knowledge: Graph = None,
    augmentation: Changes = "paper",
    more: Annotated[list[Path] | None, typer.Option("--more", help="Folder of `mfar benchmark-data` with another seed: all its \
identities of the seen types train too (repeatable).")] = None,
    start_from: Annotated[Path | None, typer.Option(help="Published HRNet weights, or a detector, to begin with.")] = None,
    precision: Precision = "float32",
    threads: Threads = 0,
    patience: Annotated[int, typer.Option(min=0, help="End after so many epochs without a better validation; 0: never.")] = 0,
    max_minutes: Budget = 0.0,
    seed: Seed = 0,
    resume: Annotated[bool, typer.Option("--resume/--fresh", help="Go on from the checkpoint in the folder.")] = True,
    as_json: Json = False,
) -> None:
    """Train a keypoint network and calibrate its confidence on the validation images."""
    from reconstruction.keypoints.report import finish
    from reconstruction.keypoints.samples_file import further, samples_of
    from reconstruction.keypoints.study import split
    from reconstruction.keypoints.train import CHECKPOINT, train

    training, validation, test = split(samples_of(data))
    training += further(data, more or [])
    folder = check_writable(out)
    settings = _settings(arch, epochs, batch, rate, sigma, weight, precision, threads, max_minutes,
                         arm=arm, seed=seed, patience=patience, augmentation=_augmentation(augmentation))
    steps = epochs * -(-len(training) // batch)
    if not resume:
        (folder / CHECKPOINT).unlink(missing_ok=True)
    with progress("training", total=steps, quiet=as_json) as advance:
        result = train(training, validation, folder, settings, knowledge=_graph(knowledge), start_from=start_from, resume=resume,
                       progress=advance)
    payload = {"out": folder, "reason": result.reason, "epochs": len(result.history), "best_epoch": result.best_epoch + 1,
               "seconds": sum(row["seconds"] for row in result.history), **finish(folder, validation, test, training=training)}
    emit(payload, as_json, _show_training)


def study_keypoints(
    data: Data,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-keypoints"),
    arms: Annotated[str, typer.Option(help="Knowledge terms, with commas; the first is compared with each other one.")]
    = "graph,none,shuffled,literal",
    seeds: Annotated[int, typer.Option(min=1, help="Runs of every arm.")] = 5,
    arch: Arch = "small",
    epochs: Epochs = 30,
    batch: Batch = 16,
    rate: Rate = 1e-3,
    sigma: Sigma = 3.0,
    weight: Weight = 0.8,
    knowledge: Graph = None,
    precision: Precision = "auto",
    threads: Threads = 0,
    max_minutes: Budget = 0.0,
    augmentation: Changes = "paper",
    start_from: Annotated[Path | None, typer.Option(help="A detector that every run begins with.")] = None,
    blazepose: Annotated[Path | None, typer.Option(help="pose_landmark_full.tflite, for an outside comparison.")] = None,
    as_json: Json = False,
) -> None:
    """Networks with and without the knowledge graph, over seeds, beside baselines; goes on where it was stopped."""
    from reconstruction.keypoints.samples_file import samples_of
    from reconstruction.keypoints.study import run

    samples = samples_of(data)
    folder = check_writable(out)
    names = [name.strip() for name in arms.split(",") if name.strip()]
    settings = _settings(arch, epochs, batch, rate, sigma, weight, precision, threads, max_minutes,
                         augmentation=_augmentation(augmentation))
    steps = epochs * -(-sum(s.split == "train" for s in samples) // batch) * seeds * len(names)
    with progress("study", total=steps, quiet=as_json) as advance:
        payload = run(samples, folder, arms=names, seeds=seeds, settings=settings, knowledge=_graph(knowledge), blazepose=blazepose,
                      start_from=start_from, mask_boxes=_mask_boxes(data, samples), progress=advance)
    emit(payload, as_json, _show_study)


def study_detector(
    data: Data,
    weights: Annotated[str, typer.Option(help="A detector of `mfar train keypoints` instead of the shipped one.")] = "shipped",
    blazepose: Annotated[Path | None, typer.Option(help="pose_landmark_full.tflite, for an outside comparison.")] = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="Output folder.")] = Path("out/study-detector"),
    as_json: Json = False,
) -> None:
    """A trained detector on the test pictures of a benchmark: by style, damage and point, beside methods that do not look."""
    from reconstruction.keypoints.predict import Detector
    from reconstruction.keypoints.samples_file import samples_of
    from reconstruction.keypoints.score import score
    from reconstruction.matching.graph import write_csv

    samples, detector = samples_of(data), Detector.load(weights)
    folder = check_writable(out)
    with progress("pictures", quiet=as_json) as advance:
        payload = score(samples, detector, blazepose=blazepose, mask_boxes=_mask_boxes(data, samples), progress=advance)
    write_csv(folder / "detector.csv", payload["rows"])
    emit(payload | {"out": folder, "weights": weights, "trained": detector.notes}, as_json, _show_detector)


def _mask_boxes(data: Path, samples):
    """What gives the boxes of the garments' masks of some samples; None where the benchmark has no masks."""
    from reconstruction.keypoints.samples_file import garment_boxes

    boxes = garment_boxes(data)
    return (lambda some: [boxes[s.image_path] for s in some]) if all(s.image_path in boxes for s in samples) else None


def _settings(arch, epochs, batch, rate, sigma, weight, precision, threads, max_minutes, **more):
    """The settings of a run; the rate drops where the paper's does, at 80 and 100 of 120 epochs."""
    from reconstruction.keypoints.hrnet import architecture
    from reconstruction.keypoints.train import TrainSettings, fast_precision

    precision = fast_precision() if precision == "auto" else precision
    return TrainSettings(
        arch=architecture(arch), epochs=epochs, batch_size=batch, learning_rate=rate, sigma=sigma, knowledge_weight=weight,
        milestones=(round(epochs * 80 / 120), round(epochs * 100 / 120)), precision=precision, threads=threads,
        max_seconds=60.0 * max_minutes, **more,
    )


def _augmentation(name: str):
    from reconstruction.keypoints.crops import WIDE, Augmentation

    known = {"paper": Augmentation(), "wide": WIDE}
    if name not in known:
        raise InputError(f"--augmentation '{name}' is none of {', '.join(known)}")
    return known[name]


def _graph(path: Path | None):
    if path is None:
        return None
    from reconstruction.keypoints.knowledge_file import load

    return load(path)


def _table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]):
    from rich.table import Table

    table = Table(title=title)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        table.add_row(*row)
    return table


def _show_points(payload: Mapping[str, Any]) -> list:
    rows = [
        [image["name"], str(int(sum(image["present"]))), f"{min(image['confidence']):.2f}", "; ".join(image["notes"])]
        for image in payload["images"]
    ]
    return [_table("Keypoints", ["picture", "points", "least confidence", "notes"], rows), *payload["notes"],
            f"written to {payload['out']}"]


def _interval(row: Mapping[str, Any], key: str, digits: int) -> str:
    text = f"{row[key]:.{digits}f}"
    return text if f"{key}_low" not in row else f"{text} ({row[f'{key}_low']:.{digits}f} to {row[f'{key}_high']:.{digits}f})"


def _score_rows(rows: Sequence[Mapping[str, Any]], name) -> list[list[str]]:
    return [[name(r), _interval(r, "rmse_input_px", 2), f"{r['median_input_px']:.2f}", _interval(r, "pck@0.1", 3)] for r in rows]


SCORES = ["RMSE, px of 256 × 192", "median, px", "PCK@0.1 of the torso"]


def _show_training(payload: Mapping[str, Any]) -> list:
    rows = _score_rows(payload["groups"], lambda r: f"{r['group']}: {r['value']}")
    text = (f"{payload['epochs']} epochs in {payload['seconds']:.0f} s ({payload['reason']}), best {payload['best_epoch']}; "
            f"calibration error {payload['calibration_error_before']:.3f} -> {payload['calibration_error']:.3f} (test images); "
            f"written to {payload['out']}")
    return [_table("Test images", ["", *SCORES], rows), text]


def _show_detector(payload: Mapping[str, Any]) -> list:
    def name(row: Mapping[str, Any]) -> str:
        return row["group"] if row["method"] == "detector" else f"{row['method']}: {row['group']}"

    rows = [[name(r), str(r["n"]), f"{r['median_input_px']:.1f}", _interval(r, "rmse_input_px", 1), f"{100 * r['within']:.0f}",
             f"{100 * r['pck@0.1']:.0f}"] for r in payload["rows"]]
    columns = ["points", "n", "median", "RMSE", "≤ 8 px, %", "PCK@0.1, %"]
    lines = [f"detector minus {name}: {d['difference']:+.1f} px ({d['low']:+.1f} to {d['high']:+.1f})"
             for name, d in payload["differences"].items()]
    title = "Held-out identities, pixels of 256 × 192, 95 % over identities"
    return [_table(title, columns, rows), *lines, f"written to {payload['out']}: detector.csv"]


def _show_study(payload: Mapping[str, Any]) -> list:
    first, shown = payload["rows"][0]["method"].removeprefix("network, "), []
    for rows, differences, what in (("rows", "differences", "All points of test images"),
                                    ("in_sight", "differences_in_sight", "Held-out identities of known types, points in sight")):
        shown.append(_table(f"{what}; 95 % intervals over identities and seeds", ["", *SCORES],
                            _score_rows(payload[rows], lambda r: r["method"])))
        shown += [f"{first} minus {arm}: {d['difference']:+.2f} px ({d['low']:+.2f} to {d['high']:+.2f})"
                  for arm, d in payload[differences].items()]
    return shown
