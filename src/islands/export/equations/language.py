"""Description of a programming language with structures: its syntax and the functions of a program."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from islands.expressions.tree import Primitive


@dataclass(frozen=True, slots=True, kw_only=True)
class Language:
    """How a language writes the statements and the functions of a program.

    Texts with braces are for `str.format`.

    Attributes
    ----------
    indent : int
        Columns of a level.
    continuation : str
        End of a line that continues.
    member, declare, variable, alias : str
        Text between a structure and its member, if the structure is an argument; text before the name of a
        new value, a new variable and a new name of a column.
    functions : mapping
        Names of functions of expressions in the language; the others have their own names.
    define : callable
        Writes the function of a primitive of models.
    zero, power, add, condition : str
        The number; a power; addition to a variable; a statement that depends on a condition.
    first : int
        Index of the first sample.
    at, past, delayed : str
        Sample of a column with an index; sample some places before ``k``; index of a sample that is delayed.
    loop, end : str
        Begin and end of a loop over the samples ``k``.
    context : tuple of str
        Last arguments of functions that read constants.
    step, time, sample_time, part : str
        Length of a step, time in a step and at a sample, and number of the part of a sample.
    value, give, finish : str
        Name of the variable with the value of a function; end of a function with the text of its value, and
        with the name of a variable, if the language requires one.
    clear : str
        Statement that sets the slope of a state to zero, if the language requires one.
    rests : str
        Operator that is a number of the record.
    output : tuple of str
        Statements before samples of the output are assigned.
    simulate_core, add_forces, loop_steps, loop_samples : str
        Statements of the simulation.
    program : str
        All functions in their order.
    derivatives, move, advance, map, forces, force_slopes, force_steps, core, signals, reader, gain, \
gain_between, band_limit : str
        Functions and parts of functions.
    moment : str
        Value of the input at three moments of each step.
    between, interpolations : mapping
        Value of a column between samples by the kind of hold; the functions that it calls, by name.
    pointer, rates : str, mapping
        Functions that differentiate or delay a signal by name, and the text before them.
    operators : mapping
        Operators of maps that are functions; see `islands.effects.interface.effect.OPERATORS`.
    definitions : mapping
        Functions of expressions that the language does not have.
    """

    indent: int
    continuation: str
    member: str
    declare: str
    variable: str
    alias: str
    functions: Mapping[str, str]
    define: Callable[[Primitive], str]
    zero: str
    power: str
    add: str
    condition: str
    first: int
    at: str
    past: str
    delayed: str
    loop: str
    end: str
    context: tuple[str, ...]
    step: str
    time: str
    sample_time: str
    part: str
    value: str
    give: str
    finish: str
    clear: str
    rests: str
    output: tuple[str, ...]
    simulate_core: str
    add_forces: str
    loop_steps: str
    loop_samples: str
    program: str
    derivatives: str
    move: str
    advance: str
    map: str
    forces: str
    force_slopes: str
    force_steps: str
    core: str
    signals: str
    reader: str
    gain: str
    gain_between: str
    band_limit: str
    moment: str
    between: Mapping[str, str]
    interpolations: Mapping[str, str]
    pointer: str
    rates: Mapping[str, str]
    operators: Mapping[str, str]
    definitions: Mapping[str, str]
