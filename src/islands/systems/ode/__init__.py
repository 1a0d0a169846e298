"""Systems of ordinary differential equations that users write as text.

Read `ode_system` first. `equation_parser` reads equations, `ode_program` translates a system to instructions,
and `ode_kernel` integrates them for sixteen sets of values at once; `native` makes machine code of them.
"""
