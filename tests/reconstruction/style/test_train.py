"""Training: continued runs equal uninterrupted ones bit by bit, the loss does what it says, files are refused by name."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from mfar_fem.errors import DataFileError, ParameterError  # noqa: E402
from reconstruction.state_dict import save_state  # noqa: E402
from reconstruction.style.align import Aligner  # noqa: E402
from reconstruction.style.checkpoint import CsvLog, read_log  # noqa: E402
from reconstruction.style.data import drawn_pool  # noqa: E402
from reconstruction.style.small_features import SmallNetwork, save_small_features  # noqa: E402
from reconstruction.style.train import CHECKPOINT, LOG, Settings, Trainer  # noqa: E402


@pytest.fixture(scope="module")
def features(tmp_path_factory):
    """Random features of the small network: enough to test the machinery without a trained file."""
    torch.manual_seed(5)
    path = tmp_path_factory.mktemp("features") / "random.pt"
    save_small_features(SmallNetwork(), path)
    return f"small={path}"


@pytest.fixture(scope="module")
def pool():
    return drawn_pool(0, 2, size=64, patch=32)


@pytest.mark.parametrize("loss", ["usable", "literal"])
def test_a_continued_run_repeats_the_uninterrupted_one(loss, features, pool, tmp_path):
    settings = {"loss": loss, "features": features, "batch": 2, "registered": loss == "literal"}
    whole = Trainer(Settings(steps=6, **settings), pool, tmp_path / "whole")
    whole.run(checkpoint_every=3, sheet_every=0)
    cut = Trainer(Settings(steps=4, **settings), pool, tmp_path / "cut")
    cut.run(checkpoint_every=3, sheet_every=0)
    # as if killed after step 4 with the last checkpoint at 3: rows 3 of the log are dropped and made again
    killed = Trainer(Settings(steps=3, **settings), pool, tmp_path / "killed")
    killed.run(checkpoint_every=3, sheet_every=0)
    killed.advance()
    for name in ("cut", "killed"):
        resumed = Trainer(Settings(steps=6, **settings), pool, tmp_path / name)
        assert resumed.step == (4 if name == "cut" else 3)
        resumed.run(checkpoint_every=3, sheet_every=0)
        assert read_log(tmp_path / name / LOG) == read_log(tmp_path / "whole" / LOG)  # every digit of every loss
        for key, value in whole.mean.items():
            assert torch.equal(value, resumed.mean[key])
    assert len({row["loss"] for row in read_log(tmp_path / "whole" / LOG)}) == 6


def test_the_usable_loss_falls_on_one_pair_and_content_is_kept(features, pool, tmp_path):
    trainer = Trainer(Settings(features=features, steps=60, batch=2, rate=2e-3, adversarial=0.0), pool, tmp_path)
    fixed = pool.batch(np.random.default_rng(7), 2)
    trainer.pool = type("Fixed", (), {"batch": lambda self, *a: fixed, "digest": pool.digest})()
    values = [trainer.advance() for _ in range(60)]
    assert values[-1]["loss"] < 0.6 * values[0]["loss"]
    assert values[-1]["style"] < 0.7 * values[0]["style"]


def test_log_sheets_and_weights_are_written(features, pool, tmp_path):
    seen = []
    trainer = Trainer(Settings(features=features, steps=2, batch=2), pool, tmp_path)
    report = trainer.run(1, 2, lambda step, values: seen.append(step))
    assert seen == [1, 2] and report["steps"] == 2
    assert {p.name for p in tmp_path.iterdir()} == {"aligner.pt", "checkpoint.pt", "log.csv", "sample-000002.png"}
    assert list(read_log(tmp_path / LOG)[0]) == ["step", "loss", "content", "style", "adversarial", "discriminator"]
    assert (tmp_path / "aligner.pt").stat().st_size < 5e6
    picture = pool.pictures[0][:50, :43]
    made = Aligner.load(tmp_path / "aligner.pt").align(picture, pool.pictures[1])
    assert made.shape == picture.shape and made.dtype == np.uint8
    assert Aligner.load(tmp_path / "aligner.pt").about["trained_steps"] == 2


def test_checkpoints_of_other_runs_are_refused(features, pool, tmp_path):
    Trainer(Settings(features=features, steps=1, batch=2), pool, tmp_path).run(1, 0)
    with pytest.raises(DataFileError, match=r"checkpoint\.pt: is of a run with other settings \(batch\)"):
        Trainer(Settings(features=features, steps=1, batch=3), pool, tmp_path)
    with pytest.raises(DataFileError, match="other pictures"):
        Trainer(Settings(features=features, steps=1, batch=2), drawn_pool(1, 2, size=64, patch=32), tmp_path)
    assert Trainer(Settings(features=features, steps=1, batch=3), pool, tmp_path, resume=False).step == 0
    (tmp_path / CHECKPOINT).write_bytes(b"broken")
    with pytest.raises(DataFileError, match="remove it"):
        Trainer(Settings(features=features, steps=1, batch=2), pool, tmp_path)


def test_a_failed_write_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "state.pt"
    save_state({"step": 1}, path)

    def fail(value, file):
        file.write_bytes(b"half")
        raise OSError("disk full")

    monkeypatch.setattr(torch, "save", fail)
    with pytest.raises(OSError, match="disk full"):
        save_state({"step": 2}, path)
    assert torch.load(path, weights_only=True) == {"step": 1}


def test_log_keeps_what_is_before_the_start(tmp_path):
    log = CsvLog(tmp_path / "log.csv", ["loss"])
    for step in range(4):
        log.write(step, {"loss": 0.1 * step})
    CsvLog(tmp_path / "log.csv", ["loss"], start=2)
    assert [row["step"] for row in read_log(tmp_path / "log.csv")] == ["0", "1"]


def test_settings_are_checked(pool, tmp_path):
    with pytest.raises(ParameterError, match="literal"):
        Settings(loss="perceptual")
    with pytest.raises(ParameterError, match="at least 1"):
        Settings(steps=0)
    with pytest.raises(DataFileError, match="no such file"):
        Aligner.load(tmp_path / "none.pt")
    torch.save({"about": {"format": "other"}}, tmp_path / "other.pt")
    with pytest.raises(DataFileError, match="mfar-style-aligner-1"):
        Aligner.load(tmp_path / "other.pt")
