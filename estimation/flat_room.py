"""Tables cut out of flat arrays in compiled code, without the call that `reshape` makes.

That call takes 33 ns, and an update cuts up its room some thirty times.
"""

from __future__ import annotations

from typing import Any

from numba.core import cgutils, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array


def _as_rows(typing_context: Any, flat: Any, rows: Any, columns: Any) -> Any:
    if not (isinstance(flat, types.Array) and flat.ndim == 1 and flat.layout == "C"):
        return None
    signature = types.Array(flat.dtype, 2, "C")(flat, types.intp, types.intp)

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = signature.return_type
        source = make_array(signature.args[0])(context, builder, arguments[0])
        table = make_array(kind)(context, builder)
        size = context.get_constant(
            types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype))
        )
        populate_array(
            table,
            data=source.data,
            shape=cgutils.pack_array(builder, list(arguments[1:])),
            strides=cgutils.pack_array(builder, [builder.mul(arguments[2], size), size]),
            itemsize=size,
            meminfo=source.meminfo,
            parent=source.parent,
        )
        value = table._getvalue()  # noqa: SLF001  (numba has no other way)
        context.nrt.incref(builder, kind, value)
        return value

    return signature, generate


as_rows: Any = intrinsic(_as_rows)
"""A flat array as a table of so many rows and columns, sharing its memory: `as_rows(flat, m, n)`.

For compiled code only. Nothing is checked: the array has to have m n entries or more."""
