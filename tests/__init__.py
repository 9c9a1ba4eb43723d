"""Tests of fricjax; the folders mirror those of the package."""
