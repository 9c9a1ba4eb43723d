"""One reader per format: a function from a path and options to a `Record`, imported only when its format occurs."""
