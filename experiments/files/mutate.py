"""Random changes of an intact file: bits, bytes, numbers, words, structure."""

import io
import json
import random
import struct
import zipfile
import zlib
from typing import Any

_NUMBERS = [0, 1, 0x7F, 0xFF, 0x7FFF, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 2**63 - 1, 2**64 - 1]
_WORDS = [
    "nan", "inf", "1e400", "-", "9" * 5000, "9**9**9 m", "\x00", "\x1b[31m", "[" * 3000, "{" * 3000, "²", "\ufeff",
    "\ud7ff", "__import__('os')", ",", ";", "\t", '"', "'", "#", "(", "0x" + "f" * 5000, "1_0", "true", "null", "{}",
    "[]",
]  # fmt: skip
_VALUES: list[Any] = [
    None, True, [], {}, "text", 0, -1, 10**30, 1e308, -1e308, 5e-324, [1], [[1]], {"type": "Run"}, {"type": "Coulomb"},
    {"type": "Mine"}, "nan", "-inf", "x" * 5000, [[[[[]]]]], {"value": 1},
]  # fmt: skip


def mutated(name: str, content: bytes, seed: int) -> bytes:
    """Apply one to three changes that depend only on name and seed."""
    chance = random.Random(f"{name} {seed}")
    for _ in range(chance.choice((1, 1, 2, 3))):
        content = _changed(name, content, chance)
    return content


def _changed(name: str, content: bytes, chance: random.Random) -> bytes:
    if name.endswith(".json") and chance.random() < 0.7:
        return _json(content, chance)
    if name.endswith((".csv", ".txt", ".toml", ".json")) and chance.random() < 0.5:
        at = chance.randrange(len(content) + 1)
        return content[:at] + chance.choice(_WORDS).encode() + content[at + chance.randrange(12) :]
    if name.endswith(".npz") and chance.random() < 0.5:
        return _zipped(content, chance)
    if name == "packed.mat" and chance.random() < 0.6:
        return _repacked(content, chance)
    return _bytes(content, chance)


def _bytes(content: bytes, chance: random.Random) -> bytes:
    data, at = bytearray(content), chance.randrange(len(content) or 1)
    size = chance.choice((1, 2, 4, 8, 64))
    match chance.randrange(8):
        case 0 | 1 if data:
            data[at] ^= 1 << chance.randrange(8)
        case 2:
            data[at : at + size] = chance.randbytes(size)
        case 3:
            width = chance.choice("BHIQ")
            number = chance.choice(_NUMBERS) & ((1 << 8 * struct.calcsize(width)) - 1)
            data[at : at + struct.calcsize(width)] = struct.pack(chance.choice("<>") + width, number)
        case 4:
            del data[at : at + size]
        case 5:
            data[at:at] = data[at // 2 : at // 2 + size]
        case 6:
            del data[at:]
        case _:
            data[at : at + size] = bytes(size)
    return bytes(data)


def _zipped(content: bytes, chance: random.Random) -> bytes:
    """Change one member of an archive and compress it correctly."""
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {name: archive.read(name) for name in archive.namelist()}
        name = chance.choice(list(members))
    except Exception:
        return _bytes(content, chance)
    head = members[name][:128]
    members[name] = _bytes(head, chance) + members[name][128:]
    target = io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        for each, data in members.items():
            archive.writestr(each, data)
    return target.getvalue()


def _repacked(content: bytes, chance: random.Random) -> bytes:
    """Change the first variable of a MATLAB file and compress it."""
    if len(content) < 136:
        return content
    size = struct.unpack_from("<I", content, 132)[0]
    try:
        inner = _bytes(zlib.decompress(content[136 : 136 + size]), chance)
    except zlib.error:
        return _bytes(content, chance)
    packed = zlib.compress(inner)
    return content[:132] + struct.pack("<I", len(packed)) + packed + content[136 + size :]


def _json(content: bytes, chance: random.Random) -> bytes:
    """Replace, remove or add one part of a JSON document."""
    try:
        document = json.loads(content)
    except (ValueError, RecursionError):
        return _bytes(content, chance)
    node: Any = document
    while isinstance(node, dict | list) and node:
        key = chance.choice(list(node)) if isinstance(node, dict) else chance.randrange(len(node))
        if isinstance(node[key], dict | list) and node[key] and chance.random() < 0.7:
            node = node[key]
            continue
        match chance.randrange(4):
            case 0:
                del node[key]
            case 1 if isinstance(node, dict):
                node["surplus"] = chance.choice(_VALUES)
            case _:
                node[key] = chance.choice(_VALUES)
        break
    return json.dumps(document).encode()
