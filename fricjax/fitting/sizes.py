"""Sizes of arrays, of which only a few occur: each is compiled for itself."""


def rounded_up(count: int, parts: int) -> int:
    """The next multiple of a power of two over `parts`, the power being the first not below `count`."""
    unit = max(2 ** (count - 1).bit_length() // parts, 1)
    return -(-count // unit) * unit
