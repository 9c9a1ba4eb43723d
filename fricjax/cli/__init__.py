"""The command line.

Commands are thin layers over the package. Heavy packages are imported only when a command starts its work.
"""
