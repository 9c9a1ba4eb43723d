"""Machines from command-line options: rig, friction law and free coefficients."""
