"""Fault injection: plants, their faults and their records. Read `plant` first, then `faults`.

Independent of the analysis under trial: nothing here imports `islands.diagnosis` or `islands.effects`.
"""
