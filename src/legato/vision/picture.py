"""Files to pictures and back: bytes in, one grey 8-bit array out, or a PictureError.

The header is read before anything is decoded, so that neither a torn file nor one that claims a
gigapixel costs more than the reading of its head.
"""

import re
import zlib

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.uint8]

MOST_PIXELS = 32_000_000
PNG_HEAD = b"\x89PNG\r\n\x1a\n"
JPEG_HEAD = b"\xff\xd8\xff"
BMP_HEAD = b"BM"
PNM_HEAD = re.compile(rb"P[1-6]\s+(?:#[^\n]*\n\s*)*(\d{1,9})\s+(\d{1,9})\s")
TELL = "give a PNG, JPEG, BMP, TIFF or PGM picture"


class PictureError(ValueError):
    """Bytes or an array that are no usable picture; says why and what to do."""


def decode(data: bytes) -> Grey:
    """Return the picture (H, W) in grey, 8 bit, of a picture file's bytes.

    16 bits are scaled to 8, colour is weighed to grey, alpha is left aside, and a camera's note of
    orientation is ignored, since the intrinsics belong to the sensor. Raises PictureError.
    """
    if not data:
        raise PictureError(f"the picture is empty (0 bytes); {TELL}")
    if data.startswith(PNG_HEAD):
        _check_png(data)
    elif data.startswith(JPEG_HEAD):
        _check_jpeg(data)
    elif data.startswith(BMP_HEAD):
        _check_bmp(data)
    elif pnm := PNM_HEAD.match(data):
        _check_size(int(pnm[1]), int(pnm[2]))
    image = _decoded(data)
    if image is None:
        raise PictureError(f"{len(data)} bytes are no picture or a damaged one; {TELL}")
    return grey(image)


def _decoded(data: bytes) -> NDArray[np.generic] | None:
    """Return what OpenCV makes of the bytes; what it would print beside is said by the error."""
    said = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        return cv2.imdecode(np.frombuffer(data, dtype=np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        raise PictureError(f"the picture cannot be decoded ({error.err}); {TELL}") from error
    finally:
        cv2.utils.logging.setLogLevel(said)


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """Return an 8-bit picture (H, W) or (H, W, 3) BGR as the bytes of a PNG file."""
    done, data = cv2.imencode(".png", image)
    if not done:
        raise PictureError(f"a picture of shape {image.shape} cannot be written as PNG")
    return bytes(data.tobytes())


def grey(image: NDArray[np.generic]) -> Grey:
    """Return the picture (H, W) in grey, 8 bit, of (H, W), BGR (H, W, 3) or BGRA (H, W, 4)."""
    a = np.asarray(image)
    if a.ndim == 3 and a.shape[2] == 1:
        a = a[:, :, 0]
    if a.ndim not in (2, 3) or a.size == 0 or (a.ndim == 3 and a.shape[2] not in (3, 4)):
        raise PictureError(f"an array of shape {a.shape} is no picture; give grey, BGR or BGRA")
    _check_size(a.shape[1], a.shape[0])
    b = _eight_bits(a)
    if b.ndim == 2:
        return b
    code = cv2.COLOR_BGR2GRAY if b.shape[2] == 3 else cv2.COLOR_BGRA2GRAY
    return np.asarray(cv2.cvtColor(b, code), dtype=np.uint8)


def _eight_bits(a: NDArray[np.generic]) -> Grey:
    """Return the array scaled to 8 bits; the depth used is the least even one that holds it."""
    if a.dtype == np.uint8:
        return np.ascontiguousarray(a, dtype=np.uint8)
    if a.dtype == np.uint16:
        # Measuring cameras write 10, 12 or 14 bits into the low end of 16.
        bits = max(8, int(a.max()).bit_length())
        return np.asarray(a.astype(np.uint32) >> (bits + bits % 2 - 8), dtype=np.uint8)
    if a.dtype in (np.float32, np.float64):
        if not np.isfinite(a.astype(float)).all():
            raise PictureError("the picture holds values that are not finite")
        top = 1.0 if float(a.astype(float).max()) <= 1.0 else 255.0
        return np.asarray(np.clip(a.astype(float) * (255.0 / top), 0, 255), dtype=np.uint8)
    raise PictureError(f"pictures of type {a.dtype} are not read; give 8 or 16 bits")


def _check_size(width: int, height: int) -> None:
    """Refuse a picture without pixels or with too many."""
    if width < 1 or height < 1:
        raise PictureError(f"the picture has no pixels ({width} x {height})")
    if width * height > MOST_PIXELS:
        raise PictureError(
            f"the picture is too large ({width} x {height}, {width * height / 1e6:.0f} megapixels; "
            f"at most {MOST_PIXELS / 1e6:.0f}); reduce it"
        )


def _check_png(data: bytes) -> None:
    """Refuse a PNG that is cut off, damaged or too large, chunk by chunk with their checksums."""
    at, last = len(PNG_HEAD), b""
    while last != b"IEND":
        length = int.from_bytes(data[at : at + 4], "big")
        end = at + 12 + length
        if end > len(data):
            raise PictureError(f"the PNG is cut off after {len(data)} bytes; copy it again")
        last = data[at + 4 : at + 8]
        if zlib.crc32(data[at + 4 : end - 4]) != int.from_bytes(data[end - 4 : end], "big"):
            raise PictureError(f"the PNG is damaged at byte {at}; copy it again")
        if last == b"IHDR":
            _check_size(
                int.from_bytes(data[at + 8 : at + 12], "big"),
                int.from_bytes(data[at + 12 : at + 16], "big"),
            )
        at = end


def _check_bmp(data: bytes) -> None:
    """Refuse a BMP that is cut off or too large."""
    width, height = (int.from_bytes(data[i : i + 4], "little", signed=True) for i in (18, 22))
    if len(data) < int.from_bytes(data[2:6], "little"):
        raise PictureError(f"the BMP is cut off after {len(data)} bytes; copy it again")
    _check_size(width, abs(height))


def _check_jpeg(data: bytes) -> None:
    """Refuse a JPEG that is cut off or too large, by walking its segments up to the scan."""
    at = 2
    while at + 9 <= len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], int.from_bytes(data[at + 2 : at + 4], "big")
        if marker == 0xFF:
            at += 1
            continue
        if 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            height = int.from_bytes(data[at + 5 : at + 7], "big")
            _check_size(int.from_bytes(data[at + 7 : at + 9], "big"), height)
        if marker == 0xDA:
            # A thumbnail inside an earlier segment has an end mark of its own.
            if data.find(b"\xff\xd9", at) < 0:
                break
            return
        at += 2 + length
    raise PictureError(f"the JPEG is cut off or damaged after {len(data)} bytes; copy it again")
