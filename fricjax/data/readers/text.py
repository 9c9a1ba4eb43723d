"""The text of a file: its encoding and its lines."""

import codecs
import dataclasses
import io
import itertools
import re
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from ...errors import DataError, UsageError

# Enough for the preamble of any instrument and some hundred rows. A longer line does not come from a table.
HEAD = 1 << 20
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
_WIDE = 1 << 28  # bytes of a file in UTF-16 or UTF-32 that are turned into UTF-8 in memory

_LINE_END = re.compile(rb"\r\n?|\n")


@dataclasses.dataclass(frozen=True)
class Text:
    """The text of a file.

    **Fields:**

    - `path`: the file.
    - `encoding`: of the text; digits are encoded as in ASCII.
    - `data`: the text, or its first megabyte if the rest stays in the file.
    - `in_file`: True if the rest stays in the file.
    """

    path: Path
    encoding: str
    data: bytes
    in_file: bool = False

    @classmethod
    def of(cls, path: Path, encoding: str | None = None) -> "Text":
        """Read the beginning of a file, or all of a short one."""
        with path.open("rb") as file:
            # The buffer for a megabyte takes more time than a short file.
            data = file.read(min(path.stat().st_size, HEAD))
        known = _encoding(path, data, encoding)
        text = cls(path, known, data, in_file=len(data) == HEAD)
        if "16" in known or "32" in known:
            if path.stat().st_size > _WIDE:
                raise DataError(f"{path.name} is larger than {_WIDE >> 20} MB in {known}; save it as UTF-8.")
            text = cls(path, "utf-8-sig", path.read_bytes().decode(known, errors="replace").encode())
        if not text.first(1):
            raise DataError(
                f"{path.name} begins with a line of more than {HEAD >> 20} MB, which is no table of numbers."
            )
        return text

    def open(self, after: int = 0) -> IO[bytes]:
        """Open the text as bytes, behind its first lines."""
        file = self.path.open("rb") if self.in_file else io.BytesIO(self.data)
        for end in itertools.islice(_LINE_END.finditer(self.data), max(after - 1, 0), after):
            file.seek(end.end())
        return file

    def parts(self, after: int) -> Iterator[bytes]:
        """Yield the lines behind the first ones, a megabyte at once."""
        with self.open(after) as file:
            while part := file.read(HEAD) + file.readline():
                yield part

    def lines(self) -> Iterator[str]:
        """Yield all lines without their line ends."""
        return self._lines_of(self.open())

    def first(self, count: int) -> list[str]:
        """Return at most `count` lines, all within the first megabyte."""
        lines = list(itertools.islice(self._lines_of(io.BytesIO(self.data[:HEAD])), count + 1))
        # The end of the megabyte may cut its last line.
        return lines[:count] if len(lines) > count or len(self.data) < HEAD else lines[:-1]

    def _lines_of(self, data: IO[bytes]) -> Iterator[str]:
        with io.TextIOWrapper(data, encoding=self.encoding, errors="replace", newline=None) as file:
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
