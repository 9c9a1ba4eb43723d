"""Fig. 3: free vibration from 1 mm."""

import free_vibration
from common import Study

REMARK = "The last half-cycle ends without crossing zero."


def study() -> Study:
    return free_vibration.study("Figure 3: free vibration from x0 = 1 mm", 1e-3, 0.176e-3, REMARK)
