"""Self-contained HTML page of a result.

The result is an archive of runs, a fit, or any other object with a report. The page is one file and loads no data from
a network: it contains the numbers, the pictures and a few hundred lines of JavaScript. A content security policy blocks
all other scripts. Python selects the content and formats the numbers; JavaScript sorts, filters and draws.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
