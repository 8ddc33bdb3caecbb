"""How a kernel becomes machine code: one optimisation and one emission for each entry point.

By default numba optimises and emits every function separately, and again in each of its callers.
Here, kernels called only by other kernels stay unoptimised LLVM IR. A kernel called from Python (an
entry point) is linked with everything it calls, optimised once and emitted. All symbols but the
entry point are internal: inlined functions are dropped, and no symbol can clash with one of the
same name in another kernel file.

The pipeline is numba's default one with another code library, through numba's extension API.
"""

from __future__ import annotations

from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import AnalysisPass, register_pass
from numba.core.typed_passes import AnnotateTypes


class InnerLibrary(JITCodeLibrary):
    """Code that only other kernels call: not linked, optimised or emitted by itself."""

    _shared_module: Any

    def finalize(self) -> None:
        """Do nothing more: whoever links this library also links what it calls."""
        self._raise_if_finalized()
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """The module for a caller that numba compiles itself: it expects all callees in one."""
        if self._shared_module is None:
            module = self._final_module.clone()
            _link_reached(self, module)
            for fn in module.functions:
                if not fn.is_declaration:
                    fn.linkage = llvm.Linkage.linkonce_odr
            self._shared_module = module
        return self._shared_module


class EntryLibrary(JITCodeLibrary):
    """Code that Python calls, with all kernels that it reaches."""

    def finalize(self) -> None:
        """Link what is called, optimise all of it together, emit it."""
        self._codegen._check_llvm_bugs()  # checks for a locale bug in LLVM, as numba does
        self._raise_if_finalized()
        module = self._final_module
        own = {fn.name for fn in module.functions if not fn.is_declaration}
        _link_reached(self, module)
        for fn in module.functions:
            if not fn.is_declaration and fn.name not in own:
                fn.linkage = llvm.Linkage.internal
        self._optimize_final_module()
        module.verify()
        self._finalize_final_module()

    def _optimize_final_module(self) -> None:
        """Inline first, so that numba can prune more reference counts; then run all passes.

        Loops are not vectorised: it costs a sixth of the time and gains nothing in these kernels,
        whose loops carry a state.
        """
        codegen = self._codegen
        for options in ({"slp_vectorize": False, "opt": 0, "cost": "cheap"}, {}):
            passes, builder = codegen._module_pass_manager(loop_vectorize=False, **options)
            passes.run(self._final_module, builder)

    def serialize_using_object_code(self) -> tuple[str, str, tuple[bytes, bytes]]:
        """Machine code, and the names that it defines.

        numba reads the names from the LLVM IR that it stores for callers; there is none here.
        """
        names = [
            fn.name for fn in self._final_module.functions
            if not fn.is_declaration and fn.linkage == llvm.Linkage.external
        ]  # fmt: skip
        defined = "".join(f'define void @"{name}"() {{ ret void }}\n' for name in names)
        return (
            self.name,
            "object",
            (self._get_compiled_object(), llvm.parse_assembly(defined).as_bitcode()),
        )


def _link_reached(library: Any, module: Any) -> None:
    """Link into `module` what the code of `library` calls, directly or through inner libraries.

    numba's own libraries come last: only symbols that are referenced by then are linked in.
    """
    inner: dict[Any, None] = {}
    others: dict[Any, None] = {}
    waiting = list(library._linking_libraries)
    while waiting:
        found = waiting.pop()
        if not isinstance(found, InnerLibrary):
            others[found] = None
        elif found not in inner:
            inner[found] = None
            waiting += found._linking_libraries
    for found in inner:
        module.link_in(found._final_module, preserve=True)
    for found in others:
        module.link_in(found._get_module_for_linking(), preserve=True)
    for found in (*inner, *others):
        library._reload_init.update(found._reload_init)


@register_pass(mutates_CFG=False, analysis_only=True)
class _TakeLibrary(AnalysisPass):
    """Before lowering: the code goes into the compiler's library; inner code is not executed."""

    _name = "take_library"

    def __init__(self) -> None:
        AnalysisPass.__init__(self)

    def run_pass(self, state: Any) -> bool:
        kind = state.kernel_library
        state.library = kind(state.targetctx.codegen(), state.func_id.func_qualname)
        if kind is InnerLibrary:
            state.flags.no_compile = True
        else:
            state.library.enable_object_caching()
        return False


class EntryCompiler(CompilerBase):
    """Compiles what Python calls."""

    library: type[JITCodeLibrary] = EntryLibrary

    def define_pipelines(self) -> list[Any]:
        """Numba's pipeline, with the library chosen before lowering."""
        self.state.kernel_library = self.library
        passes = DefaultPassBuilder.define_nopython_pipeline(self.state)
        passes.add_pass_after(_TakeLibrary, AnnotateTypes)
        passes.finalize()
        return [passes]


class InnerCompiler(EntryCompiler):
    """Compiles what other kernels call."""

    library = InnerLibrary
