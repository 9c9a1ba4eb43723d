"""Fits of plain records, many at once.

A record is plain if the law describes it and its noise is white. Such a record is fitted first, and its residuals then
prove that it is plain. No reversal, rest or noise has to be detected before.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
