"""The beginning of a text file: encoding, first lines and offsets."""

import codecs
import dataclasses
import io
import re
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from ...errors import DataError, UsageError

# Enough for the preamble of any instrument and some hundred rows. A longer line does not come from a table.
HEAD = 1 << 20
LINES = 1000  # lines to keep: the preamble, and far more rows than the layout detection needs
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_WIDE = 1 << 28  # bytes of a file in UTF-16 or UTF-32 that are turned into UTF-8 in memory
_LINE_END = re.compile(r"\r\n|\r|\n")


@dataclasses.dataclass(frozen=True)
class Text:
    """The beginning of a text file.

    **Fields:**

    - `path`: the file, for messages.
    - `encoding`: of the text.
    - `head`: the first thousand complete lines within the first megabyte.
    - `starts`: offset of each of them [bytes of the stream from `open`].
    - `wide`: the text as UTF-8 if the file is UTF-16, UTF-32 or a worksheet; else None.
    """

    path: Path
    encoding: str
    head: list[str]
    starts: list[int]
    wide: bytes | None = None

    @classmethod
    def of(cls, path: Path, encoding: str | None = None) -> "Text":
        """Read the beginning of a file.

        Raises:
            DataError: a binary file, or a line of more than a megabyte.
            UsageError: an unknown encoding.
        """
        with path.open("rb") as file:
            data = file.read(HEAD)
        known = _encoding(path, data, encoding)
        wide = None
        if "16" in known or "32" in known:
            if path.stat().st_size > _WIDE:
                raise DataError(f"{path.name} is larger than {_WIDE >> 20} MB in {known}; save it as UTF-8.")
            wide = path.read_bytes().decode(known, errors="replace").encode()
            data, known = wide[:HEAD], "utf-8-sig"
        return cls.cut(path, known, data, wide)

    @classmethod
    def cut(cls, path: Path, encoding: str, data: bytes, wide: bytes | None) -> "Text":
        """Create the text from its first megabyte, `data`, cut into lines."""
        complete = len(data) < HEAD
        head, starts = [], [0]
        for match in re.finditer(rb"[^\r\n]*(?:\r\n|\r|\n|$)", data):
            if len(head) == LINES or match.end() == match.start() or (match.end() == len(data) and not complete):
                break
            head.append(match[0].decode(encoding if match.start() == 0 else encoding.removesuffix("-sig"), "replace"))
            starts.append(match.end())
        if not head:
            raise DataError(
                f"{path.name} begins with a line of more than {HEAD >> 20} MB, which is no table of numbers."
            )
        return cls(path, encoding, [_LINE_END.sub("", line) for line in head], starts, wide)

    def open(self) -> IO[bytes]:
        """Open the text as bytes, with digits encoded as in ASCII."""
        return self.path.open("rb") if self.wide is None else io.BytesIO(self.wide)

    def lines(self) -> Iterator[str]:
        """Yield all lines without their line ends."""
        with io.TextIOWrapper(self.open(), encoding=self.encoding, errors="replace", newline=None) as file:
            for line in file:
                yield line.rstrip("\n")


def _encoding(path: Path, data: bytes, wanted: str | None) -> str:
    """Return the encoding: wanted, by byte order mark, UTF-8, or Latin-1.

    The first that applies is used.
    """
    if wanted is not None:
        try:
            return codecs.lookup(wanted).name
        except (LookupError, ValueError) as error:
            raise UsageError(f"'{wanted}' is no known text encoding; give one such as 'utf-8' or 'latin-1'.") from error
    for mark, name in _MARKS:
        if data.startswith(mark):
            return name
    if b"\x00" in data:
        even, odd = data[:4096:2].count(0), data[1:4096:2].count(0)
        half = min(len(data), 4096) // 2
        # UTF-16 without a byte order mark: every other byte is zero.
        if max(even, odd) > 0.8 * half and min(even, odd) < 0.2 * half:
            return "utf-16-le" if odd > even else "utf-16-be"
        raise DataError(f"{path.name} is binary, not text; its suffix {path.suffix} promises a text table.")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data)
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"
