"""Readers, one per format and imported on demand: path to `Record`."""
