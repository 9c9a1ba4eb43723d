"""The prototype rig of the standard workloads."""

import math

STIFFNESS, FREQUENCY, DAMPING_RATIO = 2574.0, 12.6, 0.0027
MASS = STIFFNESS / (2 * math.pi * FREQUENCY) ** 2
DAMPING = 2 * DAMPING_RATIO * math.sqrt(STIFFNESS * MASS)
LOAD, MU, X0, NOISE = 1.89, 0.01, 2e-3, 5e-9
V_S = 1e-4
SIGMA0 = 1e5
SIGMA1 = 1.4 * math.sqrt(SIGMA0 * MASS)
