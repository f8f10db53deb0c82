"""Picture files in, grey arrays out."""

import io
import zlib

import cv2
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from PIL import Image

from legato.vision.picture import PictureError, decode, encode_png, grey

RAMP = np.tile(np.arange(64, dtype=np.uint8) * 3, (48, 1))


def _file(kind: str, image: np.ndarray) -> bytes:
    return bytes(cv2.imencode(kind, image)[1].tobytes())


@pytest.mark.parametrize("kind", [".png", ".bmp", ".tiff", ".pgm"])
def test_grey_comes_through_unchanged(kind: str) -> None:
    """Every lossless kind gives its grey levels back."""
    assert np.array_equal(decode(_file(kind, RAMP)), RAMP)


def test_written_png_is_read_back() -> None:
    """What encode_png writes, decode reads."""
    assert np.array_equal(decode(encode_png(RAMP)), RAMP)


def test_jpeg_is_read() -> None:
    """A JPEG gives its picture, a little changed."""
    assert np.abs(decode(_file(".jpg", RAMP)).astype(int) - RAMP).max() < 12


def test_colour_and_alpha_become_grey() -> None:
    """BGR is weighed to grey and alpha left aside."""
    bgr = cv2.merge([RAMP, RAMP, RAMP])
    bgra = cv2.merge([RAMP, RAMP, RAMP, np.full_like(RAMP, 7)])
    for image in (bgr, bgra):
        assert np.abs(decode(_file(".png", image)).astype(int) - RAMP).max() <= 1


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_sixteen_bits_are_scaled_by_the_depth_used(bits: int) -> None:
    """Full 16 bits and a measuring camera's 10 or 12 bits in them give the same 8-bit picture."""
    full = np.tile(np.linspace(0, 255, 64).astype(np.uint16), (48, 1))
    wide = full << (bits - 8)
    assert np.array_equal(decode(_file(".png", wide)), full)


def test_floating_point_is_scaled_or_refused() -> None:
    """Levels up to 1 mean full scale; what is not finite is no picture."""
    assert np.array_equal(grey(RAMP.astype(np.float32) / np.float32(255.0)), RAMP)
    with pytest.raises(PictureError, match="not finite"):
        grey(np.full((8, 8), np.nan))


@pytest.mark.parametrize("kind", [".png", ".jpg"])
def test_cut_off_files_are_refused(kind: str) -> None:
    """A file that ends early is refused wherever it is cut, not shown half grey."""
    noisy = np.random.default_rng(0).integers(0, 256, (64, 64), dtype=np.uint8)
    whole = _file(kind, noisy)
    for part in (1, 2, 9, len(whole) // 3, len(whole) // 2, len(whole) - 20):
        with pytest.raises(PictureError):
            decode(whole[:part])


def test_empty_and_foreign_bytes_are_refused_with_what_to_give() -> None:
    """The error says why and names what is read."""
    with pytest.raises(PictureError, match="empty"):
        decode(b"")
    with pytest.raises(PictureError, match="PNG, JPEG"):
        decode(b"leg = 1\n" * 40)


def test_huge_pictures_are_refused_before_they_are_decoded() -> None:
    """Fifty megapixels are refused from the head of the file alone, PNG and JPEG."""
    head = b"IHDR" + (10000).to_bytes(4, "big") + (5000).to_bytes(4, "big") + b"\x08\0\0\0\0"
    chunk = (13).to_bytes(4, "big") + head + zlib.crc32(head).to_bytes(4, "big")
    end = b"\0\0\0\0IEND" + zlib.crc32(b"IEND").to_bytes(4, "big")
    with pytest.raises(PictureError, match="50 megapixels"):
        decode(b"\x89PNG\r\n\x1a\n" + chunk + end)
    jpeg = bytearray(_file(".jpg", RAMP))
    frame = jpeg.index(b"\xff\xc0")
    jpeg[frame + 5 : frame + 9] = (5000).to_bytes(2, "big") + (10000).to_bytes(2, "big")
    with pytest.raises(PictureError, match="50 megapixels"):
        decode(bytes(jpeg))


@settings(max_examples=150, deadline=None)
@given(
    data=st.binary(max_size=300),
    head=st.sampled_from([b"", b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM", b"P5\n9 9\n255\n"]),
)
@example(data=b"\xff" * 40, head=b"\xff\xd8\xff")
def test_no_bytes_cause_another_error(data: bytes, head: bytes) -> None:
    """Whatever is handed over, a picture or a PictureError comes back."""
    try:
        image = decode(head + data)
    except PictureError:
        return
    assert image.ndim == 2
    assert image.dtype == np.uint8


@settings(max_examples=60, deadline=None)
@given(at=st.integers(8, 600), value=st.integers(0, 255), kind=st.sampled_from([".png", ".jpg"]))
def test_damaged_files_cause_no_other_error(at: int, value: int, kind: str) -> None:
    """One changed byte gives a picture or a PictureError."""
    data = bytearray(_file(kind, RAMP))
    data[at % len(data)] = value
    try:
        image = decode(bytes(data))
    except PictureError:
        return
    assert image.ndim == 2


@pytest.mark.parametrize(
    ("mode", "name"),
    [("LA", "a.png"), ("P", "a.png"), ("P", "a.gif"), ("CMYK", "a.jpg"), ("L", "a.tiff")],
)
def test_what_other_programs_write_is_read(mode: str, name: str) -> None:
    """Grey with alpha, palettes, printers' colours and compressed TIFF give their grey levels."""
    stream = io.BytesIO()
    picture = Image.fromarray(RAMP).convert(mode)
    if mode == "CMYK":
        picture.save(stream, "jpeg", quality=100)
    elif name == "a.tiff":
        picture.save(stream, "tiff", compression="tiff_lzw")
    else:
        picture.save(stream, name[2:])
    assert np.abs(decode(stream.getvalue()).astype(int) - RAMP).max() <= 4


def test_a_note_of_orientation_is_ignored() -> None:
    """The intrinsics belong to the sensor: a picture is never turned."""
    stream, note = io.BytesIO(), Image.Exif()
    note[274] = 6
    Image.fromarray(RAMP).save(stream, "jpeg", exif=note)
    assert decode(stream.getvalue()).shape == RAMP.shape


def test_colour_of_sixteen_bits_is_scaled() -> None:
    """Colour and alpha in 16 bits give the 8-bit grey levels."""
    wide = RAMP.astype(np.uint16) * 257
    for planes in ([wide] * 3, [*[wide] * 3, np.zeros_like(wide)]):
        assert np.abs(decode(_file(".png", cv2.merge(planes))).astype(int) - RAMP).max() <= 1


def test_a_damaged_png_is_told_by_its_checksums() -> None:
    """A changed byte in the pixels is refused, not shown as stripes."""
    whole = bytearray(_file(".png", np.random.default_rng(0).integers(0, 256, (64, 64), np.uint8)))
    whole[len(whole) // 2] ^= 0x55
    with pytest.raises(PictureError, match="damaged"):
        decode(bytes(whole))


def test_heads_that_claim_too_much_are_refused() -> None:
    """BMP and PGM of a gigapixel are refused by their heads, a BMP cut off by its length."""
    bmp = bytearray(_file(".bmp", RAMP))
    with pytest.raises(PictureError, match="cut off"):
        decode(bytes(bmp[:900]))
    bmp[18:26] = (40000).to_bytes(4, "little") * 2
    for claim in (bytes(bmp), b"P5\n# note\n40000 40000\n255\n" + bytes(99)):
        with pytest.raises(PictureError, match="too large"):
            decode(claim)


def test_what_cannot_be_decoded_says_nothing_beside(capfd: pytest.CaptureFixture[str]) -> None:
    """The error is the one line that is told: OpenCV prints none of its own."""
    for kind in (".tiff", ".pgm"):
        with pytest.raises(PictureError):
            decode(_file(kind, RAMP)[:200])
    said = capfd.readouterr()
    assert (said.out, said.err) == ("", "")
