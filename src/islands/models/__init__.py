"""Models of a record: the protocol and the block that all classes have in common, NARX and parametric models.

Read `protocol` and `block` first, then `narx`.
"""
