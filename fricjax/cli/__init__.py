"""The command line: thin commands over the package. Nothing heavy is imported until a command does its work."""
