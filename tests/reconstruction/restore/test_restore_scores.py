"""Scores and report of a study whose cases are pleated tubes."""

import json
import shutil

import numpy as np
import pytest

pytest.importorskip("igl")
pytest.importorskip("embreex")

from mfar_fem.cli.main import main
from reconstruction.keypoints_file import ImageKeypoints, KeypointsFile, write_keypoints
from reconstruction.restore.scores import scores
from reconstruction.restore.study_report import (
    feature_estimates,
    fold_estimates,
    keypoint_estimates,
    keypoint_table,
    times_of,
    write_experts,
    write_study_report,
)
from reconstruction.surface.triangles import TriangleMesh


def tube(folds, flare=0.0, phase=0.0, n=160, m=60):
    v, t = np.meshgrid(2 * np.pi * np.arange(n) / n, np.linspace(0, 1, m + 1))
    r = 0.25 + flare * (1 - t) + 0.012 * np.cos(folds * v + phase)
    x = np.stack([r * np.cos(v), r * np.sin(v), t], axis=-1).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(n), np.arange(m))
    a, b = j * n + i, j * n + (i + 1) % n
    faces = [np.stack([a, b, b + n], -1).reshape(-1, 3), np.stack([a, b + n, a + n], -1).reshape(-1, 3)]
    return TriangleMesh(x, np.concatenate(faces))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    out = tmp_path_factory.mktemp("study")
    rng = np.random.default_rng(0)
    rows = []
    for seed, folds in ((1, 14), (2, 19), (3, 24)):
        case = out / "cases" / f"half-sleeve-{seed}"
        (case / "truth").mkdir(parents=True)
        truth = tube(folds)
        np.savez(case / "truth" / "geometry.npz", vertices=truth.vertices, faces=truth.faces)
        points = rng.uniform(50, 200, (12, 2))
        found = out / "keypoints" / case.name
        found.mkdir(parents=True)
        for path, shift in ((case / "truth", 0.0), (found, 3.0)):
            image = ImageKeypoints.of(out / "a.png", "mural", points + np.array([shift, 4.0 * bool(shift)]), size=(384, 512))
            write_keypoints(path / "keypoints.json", KeypointsFile((image,), "half-sleeve"))
        meshes = out / "meshes" / f"{case.name}-30mm"
        meshes.mkdir(parents=True)
        made = {"restored": truth, "MVS": tube(folds, phase=np.pi), "Pix2Vex": tube(9, flare=0.15)}
        for method, mesh in made.items():
            mesh.write(meshes / f"{method}.ply")
            rows.append({"garment": "half-sleeve", "seed": seed, "case": case.name, "edge_mm": 30.0, "method": method,
                         "mean": 5.0 + seed, "seconds": 10.0, "keypoints_s": 3.0, "template_s": 0.5, "why": ""})  # fmt: skip
    return out, rows, scores(out, [("half-sleeve", s) for s in (1, 2, 3)], 0.03)


def test_what_is_the_truth_scores_fully_and_shifted_folds_only_in_the_spectrum(study):
    _, _, scored = study
    for s in scored:
        best, shifted, other = (s["methods"][m] for m in ("restored", "MVS", "Pix2Vex"))
        assert best["mean"] < 1e-2 and best["agreement"] > 0.999 and best["spectrum"] > 0.999
        assert shifted["agreement"] < 0.5 and shifted["spectrum"] > other["spectrum"]
        assert all(same == asked for same, asked in best["features"].values())
    folds, nulls = fold_estimates(scored, "agreement")
    assert {e.method for e in folds} == {"MFAR", "MVS", "Pix2Vex"} and nulls["unrelated garments"][1] < 0.9


def test_errors_of_points_are_those_of_pictures_256_px_high(study):
    found = keypoint_estimates(study[2])
    assert len(found) == 12
    assert all(e.value == pytest.approx(5.0 / 2, rel=1e-6) and e.n == 3 for e in found)  # 3 and 4 px of 512
    apart = keypoint_estimates([study[2][0], *(s | {"garment": "veil-hat"} for s in study[2][1:])])
    assert [(e.method, e.n) for e in apart[:2]] == [("MFAR", 1), ("MFAR, held-out type", 2)]


def test_chance_is_that_of_other_garments_of_the_type(study):
    rates, chance = feature_estimates(study[2])
    assert set(chance) == {"collar and closure", "sleeve and hem", "silhouette", "accessories"}
    assert all(v > 80 for v in chance.values())  # tubes that differ in their pleats only
    assert {e.value for e in rates if e.method == "MFAR"} == {100.0}


def test_scores_are_kept_and_made_again_when_a_mesh_is_newer(study):
    out, _, scored = study
    kept = out / "scores" / "half-sleeve-1-30mm.json"
    text = json.loads(kept.read_text(encoding="utf-8"))
    kept.write_text(json.dumps(text | {"mark": 1}), encoding="utf-8")
    cases = [("half-sleeve", s) for s in (1, 2, 3)]
    assert "mark" in scores(out, cases, 0.03)[0]
    tube(14).write(out / "meshes" / "half-sleeve-1-30mm" / "poisson.ply")
    assert "poisson" in scores(out, cases, 0.03)[0]["methods"] and "poisson" not in scored[0]["methods"]
    assert set(scores(out, cases, 0.03, 0, study[1])[0]["methods"]) == {"restored", "MVS", "Pix2Vex"}  # that one has no row
    kept.write_text("{", encoding="utf-8")
    assert set(scores(out, cases, 0.03)[0]["methods"]) == {"restored", "MVS", "Pix2Vex", "poisson"}


def test_points_that_the_detector_left_out_are_counted(study):
    scored = study[2]
    changed = json.loads(json.dumps(scored))
    changed[0]["keypoints"][0] = [changed[0]["keypoints"][0][0], None, None]
    rows = keypoint_table(changed).rows
    first, total = rows[0], rows[-1]
    assert first[2:4] == [3, 1] and total[:4] == ["all points", "MFAR", 36, 1]
    assert keypoint_estimates(changed)[0].n == 2 and keypoint_estimates(changed)[0].low is None
    near = 100 * sum(share is not None and share <= 0.1 for s in changed for _, _, share in s["keypoints"]) / 36
    assert total[4] == f"{near:.0f}"
    nobody = [s | {"keypoints": []} for s in scored]
    assert keypoint_estimates(nobody) == [] and keypoint_table(nobody).rows == []


def test_rows_of_table_2_say_what_their_seconds_are_of(study):
    rows = study[1]
    assert times_of(rows)["MFAR: keypoints, template and fit of the shape; no drape"] == (pytest.approx(13.5), None)
    short = [{k: v for k, v in r.items() if k != "keypoints_s"} for r in rows]
    assert times_of(short)["MFAR: fit of the shape alone; no keypoints, template, drape"] == (pytest.approx(10.0), None)
    base = [r for r in rows if r["method"] == "restored" and not r["why"]]
    settled = [r | {"method": "draped", "seconds": 40.0 + i} for i, r in enumerate(base)]
    whole = times_of([*rows, *settled])["MFAR: keypoints, template and fit of the shape; drape at standard"]
    assert whole == (pytest.approx(13.5), pytest.approx(40.0 + 0.5 * (len(base) - 1)))
    assert times_of([*rows, *settled[1:]]) == times_of(rows)  # of all or of none


def test_the_report_and_the_form(study, capsys):
    out, rows, scored = study
    more = [*rows[:-1], rows[-1] | {"why": "nothing seen"}, rows[0] | {"method": "poisson", "why": "no surface"}]
    path = write_study_report(out, more, scored)
    text = path.read_text(encoding="utf-8")
    for words in ("Figure 4", "Figure 5", "Figure 6", "Figure 7", "Table 2", "null", "no surface", "paper, other data", "2 of 3",
                  "Pix2Vex on half-sleeve: 2 of 3", "the detector left 0 out", "worse than restored by"):  # fmt: skip
        assert words in text, words
    folder = out / "experts"
    key = json.loads((out / "experts-key.json").read_text(encoding="utf-8"))
    assert not list(folder.glob("*key*")) and len(key) == 11 and sum(e["method"] == "true" for e in key.values()) == 3
    assert all((folder / f"{letter}.png").stat().st_size > 5000 for letter in key)
    form = (folder / "form.csv").read_text(encoding="utf-8")
    assert all(letter in form for letter in key) and "roundels" not in form

    filled = form.replace(",,,\n", ",yes,yes,no\n")
    (folder / "form.csv").write_text(filled, encoding="utf-8")
    write_experts(out, rows)  # a mesh more
    longer = json.loads((out / "experts-key.json").read_text(encoding="utf-8"))
    assert len(longer) == 12 and all(longer[letter] == entry for letter, entry in key.items())
    text = (folder / "form.csv").read_text(encoding="utf-8")
    assert text.count(",yes,yes,no") == 11 * 23 and text.count(",,,\n") == 23

    command = ["study", "restore", "--experts", str(folder / "form.csv"), "--out"]
    assert main([*command, str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["garments"] == 11 and {r["method"] for r in found["rates"]} == {"restored", "MVS", "Pix2Vex"}
    assert all(r["rate"] == 100.0 and r["chance"] == 100.0 for r in found["rates"])
    assert {r["garments"] for r in found["rates"] if r["method"] == "Pix2Vex"} == {2}
    assert main([*command, str(out)]) == 0 and "11 garments with answers" in capsys.readouterr().out
    assert main([*command, str(out / "other")]) == 2 and not (out / "other").exists()


def test_a_mesh_that_was_made_anew_is_another_garment_and_an_earlier_key_leaves_the_folder(study, tmp_path):
    out, rows, _ = study
    shutil.copytree(out, tmp_path / "s")
    out = tmp_path / "s"
    (out / "experts-key.json").unlink(missing_ok=True)
    shutil.rmtree(out / "experts", ignore_errors=True)
    (out / "experts").mkdir()
    (out / "experts" / "key.json").write_text('{"G1": "a/restored"}', encoding="utf-8")
    write_experts(out, rows[:1])
    first = json.loads((out / "experts-key.json").read_text(encoding="utf-8"))
    assert not (out / "experts" / "key.json").exists() and (out / "experts-key-earlier.json").exists() and len(first) == 2
    tube(9).write(out / "meshes" / "half-sleeve-1-30mm" / "restored.ply")
    write_experts(out, rows[:1])
    second = json.loads((out / "experts-key.json").read_text(encoding="utf-8"))
    assert len(second) == 2 and len(first.keys() & second.keys()) == 1
    assert {p.stem for p in (out / "experts").glob("*.png")} == set(second)
