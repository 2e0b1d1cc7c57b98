"""CAD files made wrong in their structure: triangles of STL, lines of OBJ, the archive and the model of 3MF."""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np

Chance = np.random.Generator
_ODD = (np.nan, np.inf, -np.inf, 0.0, 1e38, -1e38, 1e-38, 1e9, -1.0, 2.0)
_SIGNS = (b"PK\1\2", b"PK\3\4", b"PK\5\6")
_DEPTH = 8
_TIMES = 60


def by_stl(raw: bytes, rng: Chance) -> bytes:
    """One number, triangle or count of a binary file replaced, removed, repeated or exchanged."""
    head = raw[:84]
    rows = [raw[i : i + 50] for i in range(84, len(raw), 50)]
    i, j = (int(k) for k in rng.integers(0, len(rows), 2))
    kind = int(rng.integers(7))
    if kind == 0:
        at = 4 * int(rng.integers(12))
        rows[i] = rows[i][:at] + struct.pack("<f", rng.choice(_ODD)) + rows[i][at + 4 :]
    elif kind == 1:
        del rows[i]
    elif kind == 2:
        rows.insert(j, rows[i])
    elif kind == 3:
        rows[i] = rows[i][:12] + rows[i][24:36] + rows[i][12:24] + rows[i][36:]
    elif kind == 4:
        rows = [row[:12] + rows[j][12:24] + row[24:] if k == i else row for k, row in enumerate(rows)]
    elif kind == 5:
        with np.errstate(all="ignore"):
            corners = np.frombuffer(b"".join(row[:48] for row in rows), "<f4") * np.float32(rng.choice(_ODD))
        rows = [corners[12 * k : 12 * k + 12].astype("<f4").tobytes() + b"\0\0" for k in range(len(rows))]
    else:
        return head[:80] + struct.pack("<I", int(rng.choice([0, 1, 2**31, 2**32 - 1]))) + b"".join(rows)
    return head[:80] + struct.pack("<I", len(rows)) + b"".join(rows)


def by_zip(raw: bytes, rng: Chance) -> bytes:
    """A number in the records of an archive, or something about its model changed."""
    if rng.random() < 0.4:
        sign = _SIGNS[int(rng.integers(len(_SIGNS)))]
        at = raw.index(sign) + int(rng.integers(4, 46))
        number = int(rng.choice([0, 1, 255, 2**16 - 1, 2**31, 2**32 - 1, int(rng.integers(2**32))]))
        size = int(rng.choice([1, 2, 4]))
        return raw[:at] + (number % 256**size).to_bytes(size, "little") + raw[at + size :]
    with zipfile.ZipFile(io.BytesIO(raw)) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    name = next(each for each in files if each.endswith(".model"))
    method = int(rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA]))
    kind = int(rng.integers(4))
    if kind == 0:
        files[name] = _nested(files[name])
    elif kind == 1:
        files[name] += b" " * int(rng.choice([10**6, 7 * 10**7]))
    else:
        from benchmarks.fuzz_mutate import by_tokens, by_xml

        files[name] = (by_xml if kind == 2 else by_tokens)(files[name], rng)
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method if rng.random() < 0.2 else zipfile.ZIP_DEFLATED) as archive:
        for each, text in files.items():
            archive.writestr(each, text)
    return out.getvalue()


def _nested(model: bytes) -> bytes:
    """Objects in objects in objects, sixty of each."""
    inner = "".join(
        f'<object id="{n}"><components>{f"""<component objectid="{n - 1}"/>""" * _TIMES}</components></object>'
        for n in range(101, 101 + _DEPTH)
    )
    first = '<object id="100"><components><component objectid="1"/></components></object>'
    model = model.replace(b"</resources>", f"{first}{inner}</resources>".encode())
    return model.replace(b"</build>", f'<item objectid="{100 + _DEPTH}"/></build>'.encode())
