"""Verdict on a fit: whether its model describes the record, and which term it misses."""
