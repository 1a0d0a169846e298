"""Sizes below which a number counts as zero, and the size of the deviations of a normal variable."""

#: Result relative to the numbers from which it is computed that counts as zero: a sum of cancelling terms, or
#: the residual of an exact simulation. Seven of sixteen digits are left for the rounding of a long record.
ROUNDING = 1e-9

#: Difference relative to the range of a signal that counts as zero: files have six or seven digits.
RESOLUTION = 1e-6

#: Median of the absolute values of a normal variable of standard deviation 1.
NORMAL_MEDIAN = 0.6745

#: Standard errors from an estimate to the ends of its 95 % interval (normal distribution).
NORMAL_95 = 1.96
