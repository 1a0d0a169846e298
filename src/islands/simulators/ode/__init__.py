"""Systems of ordinary differential equations that users write as text.

Read `system` first. `equation_parser` reads equations, `program` translates a system to instructions,
and `kernel` integrates them for sixteen sets of values at once; `native_code` makes machine code of them.
"""
