"""Kernels that are called by kernels: they are optimised once, in the machine code of the outermost caller.

Numba compiles a callee completely, to machine code with a wrapper for Python, and then optimises it again in
each caller that contains it. A callee compiled here remains intermediate code until it is linked.
"""

from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, Flags, compile_extra
from numba.core.dispatcher import _FunctionCompiler
from numba.core.registry import CPUDispatcher


class Callee(CPUDispatcher):
    """Dispatcher of a kernel for calls from other kernels.

    Parameters
    ----------
    function : callable
    options : dict
        Options of Numba.
    constants : sequence of str
        Parameters whose value must be known to the compiler. There is one version of the kernel for each of
        their values; other integers have one type, also if the caller passes a literal.
    """

    def __init__(
        self, function: Callable[..., Any], options: dict[str, Any], constants: tuple[str, ...]
    ) -> None:
        super().__init__(function, targetoptions=options)
        self._compiler = _CalleeCompiler(function, self.targetdescr, options, {}, Compiler)
        self._compiler.constants = constants

    def add_overload(self, cres: Any) -> None:
        """Add a version, which has no entry point for Python."""
        self.overloads[tuple(cres.signature.args)] = cres


class _Library(JITCodeLibrary):
    """Intermediate code of a kernel and of those that it calls."""

    def finalize(self) -> None:
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        self._finalized = True


class _CalleeCompiler(_FunctionCompiler):
    constants: tuple[str, ...] = ()

    def fold_argument_types(self, args: Any, kws: Any) -> Any:
        """Return the signature of the function, and the types of all arguments."""
        signature, types_of_all = super().fold_argument_types(args, kws)
        widened = (
            argument if name in self.constants else types.unliteral(argument)
            for name, argument in zip(signature.parameters, types_of_all, strict=True)
        )
        return signature, tuple(widened)

    def _compile_core(self, args: Any, return_type: Any) -> Any:
        flags = Flags()
        self.targetdescr.options.parse_as_flags(flags, self.targetoptions)
        flags.no_compile = flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
        context = self.targetdescr.target_context
        library = _Library(context.codegen(), self.py_func.__qualname__)
        compiled = compile_extra(
            self.targetdescr.typing_context,
            context,
            self.py_func,
            args,
            return_type,
            flags,
            self.locals,
            library,
            self.pipeline_class,
        )
        key = object()  # identifies the function; there is no machine code to point to
        context.insert_user_function(key, compiled.fndesc, [library])
        return compiled._replace(entry_point=key)
