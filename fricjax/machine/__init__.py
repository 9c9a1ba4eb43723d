"""From words and numbers to a machine: laws by name, the rig, and which coefficients are free."""
