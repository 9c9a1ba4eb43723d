"""One self-contained page of a result: an archive of runs, a fit, or whatever else shows itself by tables and facts.

The page is one file of HTML without anything from a network: its numbers, its pictures and the few hundred lines of
JavaScript that draw them lie in it, and a content security policy lets nothing else run. Python says what is shown and
how numbers are written; JavaScript sorts, filters and draws.
"""

import lazy_loader as _lazy_loader

__getattr__, __dir__, __all__ = _lazy_loader.attach_stub(__name__, __file__)
