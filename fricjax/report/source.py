"""Kind of source at a path, without opening it or heavy imports."""

from pathlib import Path
from typing import Literal

from ..errors import DataError

ENDINGS = (".html", ".htm")
# The file with the settings of an archive; it exists from the first start.
_STUDY, _PARTS = "study.json", ("study.json", "table.parquet")


def kind_of(path: Path) -> Literal["archive", "fit"]:
    """Distinguish the folder of an archive from the file of a fit.

    Raises:
        DataError: the path is neither.

    Examples:
        >>> from pathlib import Path
        >>> kind_of(Path("fit.csv"))
        Traceback (most recent call last):
        ...
        fricjax.errors.DataError: There is no file or folder fit.csv. Check the path.
    """
    if path.is_dir():
        if not (path / _STUDY).is_file():
            raise DataError(
                f"The folder {path} holds no archive: there is no {_STUDY} in it. Give the folder that fricjax batch "
                "wrote, or the file of a fit."
            )
        return "archive"
    if not path.exists():
        raise DataError(f"There is no file or folder {path}. Check the path.")
    if path.name in _PARTS and (path.parent / _STUDY).is_file():
        raise DataError(f"{path} is a part of an archive. Give its folder, {path.parent}.")
    if path.suffix.lower() != ".json":
        raise DataError(
            f"{path} is neither an archive nor a fit. Give the folder that fricjax batch wrote, or a fit that "
            "fit.save() or fricjax fit --out wrote (.json)."
        )
    return "fit"
