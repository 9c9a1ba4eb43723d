"""A progress bar on stderr."""

from collections.abc import Iterable, Iterator


def progressing[T](items: Iterable[T], total: int, description: str, *, shown: bool) -> Iterator[T]:
    """Pass the items on, with a bar on stderr that counts them where it is to be `shown`."""
    if not shown:
        yield from items
        return
    from rich.console import Console
    from rich.progress import track

    yield from track(items, description, total, console=Console(stderr=True))
