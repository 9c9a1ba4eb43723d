"""Fig. 2: free vibration from 3 mm."""

import free_vibration
from common import Study

REMARK = 'The reversal that the paper puts "near 0.1 s" is the second one, after a period of 0.0889 s.'


def study() -> Study:
    return free_vibration.study("Figure 2: free vibration from x0 = 3 mm", 3e-3, -0.139e-3, REMARK)
