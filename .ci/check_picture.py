"""Fails unless the file is a whole PNG, at least 640×360, of many colours. Standard library only."""

import struct
import sys
import zlib


def chunks(data):
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "no PNG signature"
    at = 8
    while at < len(data):
        length, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + length]
        (crc,) = struct.unpack_from(">I", data, at + 8 + length)
        assert crc == zlib.crc32(kind + body), f"{kind}: checksum"
        yield kind, body
        at += 12 + length


def main(path):
    with open(path, "rb") as file:
        found = list(chunks(file.read()))
    assert found[0][0] == b"IHDR" and found[-1] == (b"IEND", b""), "not whole"
    width, height, depth, color = struct.unpack_from(">IIBB", found[0][1])
    assert width >= 640 and height >= 360, f"{width}×{height} is small"
    samples = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[color]
    row = 1 + (width * depth * samples + 7) // 8
    pixels = zlib.decompress(b"".join(body for kind, body in found if kind == b"IDAT"))
    assert len(pixels) == row * height, "pixels are missing"
    rows = {pixels[i * row : (i + 1) * row] for i in range(height)}
    assert len(rows) > height // 4, f"only {len(rows)} different rows of {height}: an empty picture?"
    print(f"{path}: {width}×{height}, {len(rows)} different rows")


main(sys.argv[1])
