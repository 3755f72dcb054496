"""SIMD registers in compiled kernels, for sums that are too short for a compiler to vectorise.

Fronts are short (thirty to some hundred unknowns) and their rows begin at any address, so that loops over them consist
mostly of remainders, which a compiler processes number by number. Here a remainder is a register of which only the
first numbers count. `numbers` gives the address of an array without a reference count: the caller must keep the array
alive while the address is used.
"""

from __future__ import annotations

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, models, register_model
from numba.np.arrayobj import make_array

from ...compiled import UNCOUNTED, part

#: Bytes of a register. On processors without registers of 64 bytes, two of 32 are combined.
BYTES = 64

_COUNT = ir.IntType(32)


class Lanes(types.Type):
    """A register of numbers of ``dtype``."""

    def __init__(self, dtype: types.Float) -> None:
        self.dtype = dtype
        super().__init__(name=f"Lanes({dtype})")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind) -> None:
        super().__init__(manager, kind, _vector(kind.dtype))


def _vector(dtype: types.Float) -> ir.VectorType:
    return ir.VectorType(ir.FloatType() if dtype == types.float32 else ir.DoubleType(), 8 * BYTES // dtype.bitwidth)


def _places(numbers) -> ir.Constant:
    numbers = list(numbers)
    return ir.Constant(ir.VectorType(_COUNT, len(numbers)), numbers)


def _first(builder, vector, n):
    """Mask of the first ``n`` numbers of a register."""
    undefined = ir.Constant(ir.VectorType(_COUNT, vector.count), ir.Undefined)
    one = builder.insert_element(undefined, builder.trunc(n, _COUNT), _COUNT(0))
    many = builder.shuffle_vector(one, undefined, _places([0] * vector.count))
    return builder.icmp_signed("<", _places(range(vector.count)), many)


def _call(builder, name, vector, result, given, suffix=""):
    """Call the LLVM function ``name`` for this type of register."""
    bits = 32 if vector.element == ir.FloatType() else 64
    kinds = ir.FunctionType(result, [value.type for value in given])
    name = f"llvm.{name}.v{vector.count}f{bits}{suffix}"
    return builder.call(cgutils.get_or_insert_function(builder.module, kinds, name), given)


def _address(builder, args, vector):
    return builder.bitcast(builder.gep(args[0], [args[1]]), vector.as_pointer())


@intrinsic
def numbers(typingctx, array):
    """Address of the first number of a contiguous ``array``. Others are refused: their numbers do not follow one another."""
    if array.layout != "C":
        raise TypingError(
            f"a kernel reads numbers one after the other, but {array} is not stored so: pass it by ascontiguousarray"
        )

    def codegen(context, builder, signature, args):
        return make_array(signature.args[0])(context, builder, args[0]).data

    return types.CPointer(array.dtype)(array), codegen


@intrinsic
def beyond(typingctx, where, index):
    """Address of the number that is so many numbers further on."""

    def codegen(context, builder, signature, args):
        return builder.gep(args[0], [args[1]])

    return where(where, types.intp), codegen


@intrinsic
def zeros(typingctx, where):
    """A register of zeros of the type at this address."""

    def codegen(context, builder, signature, args):
        return ir.Constant(_vector(signature.return_type.dtype), None)

    return Lanes(where.dtype)(where), codegen


@intrinsic
def load(typingctx, where, index):
    """A register of the numbers from ``index`` on."""

    def codegen(context, builder, signature, args):
        dtype = signature.return_type.dtype
        return builder.load(_address(builder, args, _vector(dtype)), align=dtype.bitwidth // 8)

    return Lanes(where.dtype)(where, types.intp), codegen


@intrinsic
def load_first(typingctx, where, index, n):
    """As `load`; only the first ``n`` numbers are read, the others are zero."""

    def codegen(context, builder, signature, args):
        dtype = signature.return_type.dtype
        vector = _vector(dtype)
        align = _COUNT(dtype.bitwidth // 8)
        given = [_address(builder, args, vector), align, _first(builder, vector, args[2]), ir.Constant(vector, None)]
        return _call(builder, "masked.load", vector, vector, given, ".p0")

    return Lanes(where.dtype)(where, types.intp, types.intp), codegen


@intrinsic
def load_six(typingctx, where, index):
    """`load_first` of six numbers, which does not wait for a preceding write to adjacent addresses."""

    def codegen(context, builder, signature, args):
        dtype = signature.return_type.dtype
        vector = _vector(dtype)
        six = ir.VectorType(vector.element, 6)
        these = builder.load(_address(builder, args, six), align=dtype.bitwidth // 8)
        return builder.shuffle_vector(these, ir.Constant(six, None), _places([*range(6), *[6] * (vector.count - 6)]))

    return Lanes(where.dtype)(where, types.intp), codegen


@intrinsic
def store_six(typingctx, where, index, value):
    """`store_first` of six numbers; see `load_six`."""

    def codegen(context, builder, signature, args):
        vector = args[2].type
        six = ir.VectorType(vector.element, 6)
        these = builder.shuffle_vector(args[2], ir.Constant(vector, ir.Undefined), _places(range(6)))
        builder.store(these, _address(builder, args, six), align=signature.args[2].dtype.bitwidth // 8)
        return context.get_dummy_value()

    return types.void(where, types.intp, value), codegen


@intrinsic
def store(typingctx, where, index, value):
    """Write the register ``value`` to the numbers from ``index`` on."""

    def codegen(context, builder, signature, args):
        align = signature.args[2].dtype.bitwidth // 8
        builder.store(args[2], _address(builder, args, args[2].type), align=align)
        return context.get_dummy_value()

    return types.void(where, types.intp, value), codegen


@intrinsic
def store_first(typingctx, where, index, value, n):
    """As `store`; only the first ``n`` numbers are written."""

    def codegen(context, builder, signature, args):
        vector = args[2].type
        align = _COUNT(signature.args[2].dtype.bitwidth // 8)
        given = [args[2], _address(builder, args, vector), align, _first(builder, vector, args[3])]
        _call(builder, "masked.store", vector, ir.VoidType(), given, ".p0")
        return context.get_dummy_value()

    return types.void(where, types.intp, value, types.intp), codegen


@intrinsic
def spread(typingctx, where, index):
    """A register filled with the number at ``index``."""

    def codegen(context, builder, signature, args):
        vector = _vector(signature.return_type.dtype)
        undefined = ir.Constant(vector, ir.Undefined)
        one = builder.insert_element(undefined, builder.load(builder.gep(args[0], [args[1]])), _COUNT(0))
        return builder.shuffle_vector(one, undefined, _places([0] * vector.count))

    return Lanes(where.dtype)(where, types.intp), codegen


@intrinsic
def plus(typingctx, a, b):
    """a + b."""

    def codegen(context, builder, signature, args):
        return builder.fadd(*args)

    return a(a, b), codegen


@intrinsic
def minus(typingctx, a, b):
    """a − b."""

    def codegen(context, builder, signature, args):
        return builder.fsub(*args)

    return a(a, b), codegen


@intrinsic
def product(typingctx, a, b):
    """a b."""

    def codegen(context, builder, signature, args):
        return builder.fmul(*args)

    return a(a, b), codegen


@intrinsic
def plus_product(typingctx, total, a, b):
    """``total`` + a b, fused where the processor can."""

    def codegen(context, builder, signature, args):
        return _call(builder, "fmuladd", args[0].type, args[0].type, [args[1], args[2], args[0]])

    return total(total, a, b), codegen


@intrinsic
def minus_product(typingctx, total, a, b):
    """``total`` − a b, fused where the processor can."""

    def codegen(context, builder, signature, args):
        return _call(builder, "fmuladd", args[0].type, args[0].type, [builder.fneg(args[1]), args[2], args[0]])

    return total(total, a, b), codegen


@intrinsic
def sums(typingctx, a, b, c, d, e, f):
    """The sums over each of six registers, as the first six numbers of one register."""

    def codegen(context, builder, signature, args):
        # Each of ``these`` holds partial sums, in groups of this length, whose halves are added.
        these, length, whole = list(args), args[0].type.count, args[0].type
        while length > 1:
            half, halved = length // 2, []
            pairs = zip(these[::2], these[1::2] + these[-1:], strict=False) if len(these) > 1 else [(these[0], None)]
            for x, y in pairs:
                n = x.type.count * (1 if y is None else 2)
                parts = [_places([k + at + i for k in range(0, n, length) for i in range(half)]) for at in (0, half)]
                halved.append(builder.fadd(*(builder.shuffle_vector(x, x if y is None else y, part) for part in parts)))
            these, length = halved, half
        n = these[0].type.count
        return builder.shuffle_vector(these[0], these[0], _places([k % n for k in range(whole.count)]))

    return a(a, b, c, d, e, f), codegen


@part(error_model="numpy", nogil=True, **UNCOUNTED)
def copy(given, at, taken, to, n, width):
    """Copy n numbers from position ``at`` of ``given`` to position ``to`` of ``taken``; a register holds ``width``
    numbers."""
    j = 0
    while j + width <= n:
        store(taken, to + j, load(given, at + j))
        j += width
    if j < n:
        store_first(taken, to + j, load_first(given, at + j, n - j), n - j)
