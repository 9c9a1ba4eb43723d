"""Sizes of arrays, of which only a few occur: each is compiled for itself."""


def power(count: int, least: int, factor: int = 2) -> int:
    """The first of `least`, `least` times `factor`, times `factor` again ... that is not below `count`."""
    size = least
    while size < count:
        size *= factor
    return size


def filled(count: int, least: int, most: int, factor: int) -> int:
    """The same up to a size of `most`, and beyond, where records are few and a filling costs, eighths of a power."""
    if count <= most:
        return power(count, least, factor)
    unit = power(count, most) // 8
    return -(-count // unit) * unit
