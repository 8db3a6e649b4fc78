"""Pictures: each way of being unusable has its own error; what is done to a usable one is noted and right."""

from __future__ import annotations

import struct
import zlib
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from PIL import Image, ImageOps

from mfar_fem.errors import InputError
from reconstruction import images


def texture(height=48, width=64, seed=0):
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def saved(picture, kind="PNG", **options) -> bytes:
    buffer = BytesIO()
    picture.save(buffer, kind, **options)
    return buffer.getvalue()


PNG = saved(Image.fromarray(texture()))
JPEG = saved(Image.fromarray(texture()), "JPEG", quality=90)


def bomb(width, height) -> bytes:
    """A PNG whose header claims any size."""
    header = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunk = struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header))
    return PNG[:8] + chunk + PNG[33:]


def test_a_sound_picture_comes_back_as_it_is_and_cannot_be_written(tmp_path):
    (tmp_path / "a.png").write_bytes(PNG)
    image = images.load(tmp_path / "a.png")
    assert np.array_equal(image.rgb, texture()) and image.notes == () and image.original_size == (64, 48) == image.size
    assert len(image.digest) == 64 and image.grey.shape == (48, 64)
    with pytest.raises(ValueError, match="read-only"):
        image.rgb[0, 0] = 0


@pytest.mark.parametrize(
    ("name", "data", "error", "says"),
    [
        ("a.png", b"", images.EmptyFileError, "no bytes"),
        ("a.png", b"hello, not a picture", images.UnreadableImageError, "is not a picture"),
        ("a.png", JPEG, images.WrongExtensionError, r"rename it to '\.jpg'"),
        ("a", PNG, images.WrongExtensionError, "no extension"),
        ("a.jpg", JPEG[: len(JPEG) // 2], images.TruncatedImageError, "ends too early"),
        ("a.png", PNG[: len(PNG) // 2], images.TruncatedImageError, "ends too early"),
        ("a.png", saved(Image.fromarray(texture(31, 200))), images.TooSmallImageError, "200 x 31"),
        ("a.png", bomb(20000, 20000), images.TooLargeImageError, "100,000,000"),
        ("a.png", bomb(12000, 10000), images.TooLargeImageError, "12000 x 10000"),
        ("a.png", saved(Image.new("RGB", (64, 64))), images.ConstantImageError, "black"),
        ("a.png", saved(Image.new("RGB", (64, 64), (9, 8, 7))), images.ConstantImageError, r"\(9, 8, 7\)"),
    ],
)
def test_each_unusable_picture_has_its_own_error_that_names_the_file(tmp_path, name, data, error, says):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(error, match=says) as caught:
        images.load(tmp_path / name)
    assert str(tmp_path / name) in str(caught.value) and isinstance(caught.value, InputError)


def test_missing_file_and_folder_are_unreadable(tmp_path):
    for path in (tmp_path / "none.png", tmp_path):
        with pytest.raises(images.UnreadableImageError):
            images.load(path)


def test_the_header_is_refused_before_anything_is_decoded(monkeypatch):
    monkeypatch.setattr("PIL.ImageFile.ImageFile.load", lambda self: pytest.fail("decoded"))
    with pytest.raises(images.TooLargeImageError):
        images.decode(bomb(11000, 11000), "a.png")


def test_transparency_is_composited_on_white_and_noted():
    rgba = np.dstack([texture(), np.zeros((48, 64), np.uint8)])
    rgba[:, 32:, 3] = 255
    image = images.decode(saved(Image.fromarray(rgba)), "a.png")
    assert (image.rgb[:, :32] == 255).all() and np.array_equal(image.rgb[:, 32:], rgba[:, 32:, :3])
    assert image.notes == ("transparency composited on white",)


def test_sixteen_bits_are_scaled_to_eight():
    ramp = np.linspace(0, 65535, 64 * 48).reshape(48, 64).astype(np.uint16)
    image = images.decode(saved(Image.fromarray(ramp)), "a.png")
    assert np.abs(image.rgb[..., 0] - ramp / 257.0).max() <= 0.51
    assert "16 bits" in image.notes[0]


def test_sixteen_bit_colours_of_a_tiff_are_noted(tmp_path):
    cv2 = pytest.importorskip("cv2")
    deep = np.random.default_rng(0).integers(0, 65536, (48, 64, 3), dtype=np.uint16)
    cv2.imwrite(str(tmp_path / "a.tif"), deep)
    image = images.load(tmp_path / "a.tif")
    assert "16 bits a channel scaled to 8" in image.notes
    assert np.abs(image.rgb - deep[..., ::-1] / 257.0).max() <= 1.01


def test_floats_are_stretched_and_nan_is_refused():
    ramp = np.linspace(-1, 3, 64 * 48).reshape(48, 64).astype(np.float32)
    image = images.decode(saved(Image.fromarray(ramp), "TIFF"), "a.tif")
    assert image.rgb.min() == 0 and image.rgb.max() == 255 and "floating point" in image.notes[0]
    ramp[3, 4] = np.nan
    with pytest.raises(images.NotFiniteImageError, match="NaN"):
        images.decode(saved(Image.fromarray(ramp), "TIFF"), "a.tif")


@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_applied_as_pillow_does(orientation):
    exif = Image.Exif()
    exif[0x0112] = orientation
    data = saved(Image.fromarray(texture()), "PNG", exif=exif)
    image = images.decode(data, "a.png")
    assert np.array_equal(image.rgb, np.asarray(ImageOps.exif_transpose(Image.open(BytesIO(data)))))
    assert image.original_size == (64, 48) and bool(image.notes) == (orientation != 1)


def test_grey_and_cmyk_are_converted_and_noted():
    grey = images.decode(saved(Image.fromarray(texture()).convert("L")), "a.png")
    assert grey.notes == ("greyscale",) and np.ptp(grey.rgb.astype(int), axis=2).max() == 0
    assert np.array_equal(grey.grey, grey.rgb[..., 0])
    smooth = Image.fromarray(np.broadcast_to(np.linspace(0, 255, 64).astype(np.uint8)[None, :, None], (48, 64, 3)).copy())
    cmyk = images.decode(saved(smooth.convert("CMYK"), "JPEG", quality=100), "a.jpg")
    assert "CMYK" in cmyk.notes[0] and np.abs(cmyk.rgb.astype(int) - np.asarray(smooth)).max() < 6


def is_an_image_or_a_named_error(data, name):
    try:
        image = images.decode(data, name)
    except images.ImageError as error:
        assert name in str(error)
    else:
        assert image.rgb.dtype == np.uint8 and image.rgb.ndim == 3 and min(image.size) >= images.SMALLEST


@hypothesis_settings(max_examples=150)
@given(data=st.data())
def test_damaged_bytes_give_an_image_or_the_named_error_and_nothing_else(data):
    name, whole = data.draw(st.sampled_from([("a.jpg", JPEG), ("a.png", PNG)]))
    damaged = bytearray(whole[: data.draw(st.integers(0, len(whole)))])
    for _ in range(data.draw(st.integers(0, 8))):
        if damaged:
            damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    is_an_image_or_a_named_error(bytes(damaged), name)


SIGNATURES = [b"", PNG[:33], JPEG[:20], b"II*\0", b"BM", b"RIFF\0\0\0\0WEBPVP8 ", b"P6 64 64 255 "]


@hypothesis_settings(max_examples=80)
@given(st.binary(max_size=400), st.sampled_from(SIGNATURES))
def test_noise_behind_any_signature_gives_the_named_error_or_an_image(noise, signature):
    is_an_image_or_a_named_error(signature + noise, "a.png")
