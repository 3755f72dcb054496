"""Eight numbers at a time: a numba type whose every operation is one vector instruction, and what is built of it.

Compilers find such instructions by themselves only in loops that they can see through. `Lanes` asks for them: + − × ÷
of lanes with lanes or with a number, and the functions below. What comes out of a lane depends on what went into it and
on nothing else, neither on its place nor on its neighbours. Products may be fused with sums where the processor can.

    load(array, at)             lanes at …, at + 7 of a flat array
    store(array, at, x)
    gather(array, at, places, first)        lane k from place at + places[first + k] of a flat array
    scatter(array, at, places, first, x)    lane k into that place
    splat(number)               the same in every lane
    less(a, b, x, y)            x where a < b, else y
    root(x), size(x)            √x, |x|
    signed(x, s)                |x| with the sign of s (that of a zero too)
    log(x), angle(y, x)         within 2 ulp for x > 0 normal; atan2 with signed zeros

numba's cache asks for the date of the file a kernel stands in: after a change here, touch those of its users.
"""

from __future__ import annotations

import math
import operator

from llvmlite import ir
from numba import njit, types
from numba.core import cgutils
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

WIDTH = 8

_F8 = ir.VectorType(ir.DoubleType(), WIDTH)
_I8 = ir.VectorType(ir.IntType(64), WIDTH)
#: A product and a sum may become one instruction; nothing else is given away.
_FUSE = ("contract",)


class LanesType(types.Type):
    def __init__(self):
        super().__init__("Lanes")


lanes = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _F8)


def _wide(builder, kind, value):
    """``value`` of numba type ``kind`` in every lane, unless it is lanes already."""
    if kind is lanes:
        return value
    if isinstance(kind, types.Integer):
        value = builder.sitofp(value, ir.DoubleType())
    one = builder.insert_element(ir.Constant(_F8, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    every = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_F8, ir.Undefined), every)


def _register(function, instruction):
    @type_callable(function)
    def typer(context):
        def typed(a, b):
            if lanes in (a, b) and all(k is lanes or isinstance(k, (types.Float, types.Integer)) for k in (a, b)):
                return lanes
            return None

        return typed

    def lower(context, builder, sig, args):
        a, b = (_wide(builder, kind, value) for kind, value in zip(sig.args, args))
        return getattr(builder, instruction)(a, b, flags=_FUSE)

    for pair in (
        (lanes, lanes),
        (lanes, types.Float),
        (types.Float, lanes),
        (lanes, types.Integer),
        (types.Integer, lanes),
    ):
        lower_builtin(function, *pair)(lower)


_register(operator.add, "fadd")
_register(operator.sub, "fsub")
_register(operator.mul, "fmul")
_register(operator.truediv, "fdiv")


@type_callable(operator.neg)
def _negated(context):
    return lambda a: lanes if a is lanes else None


@lower_builtin(operator.neg, lanes)
def _negate(context, builder, sig, args):
    return builder.fneg(args[0])


def _address(context, builder, kind, array, at):
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [at]), _F8.as_pointer())


@intrinsic
def load(typing, array, at):
    def code(context, builder, sig, args):
        found = builder.load(_address(context, builder, sig.args[0], *args))
        found.align = 8
        return found

    return lanes(array, types.intp), code


@intrinsic
def store(typing, array, at, x):
    def code(context, builder, sig, args):
        builder.store(args[2], _address(context, builder, sig.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return types.none(array, types.intp, lanes), code


def _addresses(context, builder, sig, array, at, places, first):
    """Of one lane after the other."""
    data = builder.gep(context.make_array(sig.args[0])(context, builder, array).data, [at])
    places = builder.gep(context.make_array(sig.args[2])(context, builder, places).data, [first])
    for k in range(WIDTH):
        place = builder.load(builder.gep(places, [ir.Constant(ir.IntType(64), k)]))
        yield ir.Constant(ir.IntType(32), k), builder.gep(data, [place])


@intrinsic
def gather(typing, array, at, places, first):
    def code(context, builder, sig, args):
        out = ir.Constant(_F8, ir.Undefined)
        for k, address in _addresses(context, builder, sig, *args):
            out = builder.insert_element(out, builder.load(address), k)
        return out

    return lanes(array, types.intp, places, types.intp), code


@intrinsic
def scatter(typing, array, at, places, first, x):
    def code(context, builder, sig, args):
        for k, address in _addresses(context, builder, sig, *args[:4]):
            builder.store(builder.extract_element(args[4], k), address)
        return context.get_dummy_value()

    return types.none(array, types.intp, places, types.intp, lanes), code


@intrinsic
def splat(typing, number):
    return lanes(types.float64), lambda context, builder, sig, args: _wide(builder, types.float64, args[0])


@intrinsic
def less(typing, a, b, x, y):
    def code(context, builder, sig, args):
        a, b, x, y = (_wide(builder, kind, value) for kind, value in zip(sig.args, args))
        return builder.select(builder.fcmp_ordered("<", a, b), x, y)

    return lanes(a, b, x, y), code


def _by_llvm(name: str, n: int):
    def code(context, builder, sig, args):
        return builder.call(cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_F8, [_F8] * n), f"llvm.{name}.v{WIDTH}f64"), args)  # fmt: skip

    return code


@intrinsic
def root(typing, x):
    return lanes(lanes), _by_llvm("sqrt", 1)


@intrinsic
def size(typing, x):
    return lanes(lanes), _by_llvm("fabs", 1)


@intrinsic
def signed(typing, x, s):
    return lanes(lanes, lanes), _by_llvm("copysign", 2)


def _each(value: int):
    return ir.Constant(_I8, [value] * WIDTH)


@intrinsic
def _parts(typing, x):
    """x = m 2ⁿ with m from √½ to √2: (m, n)."""

    def code(context, builder, sig, args):
        bits = builder.bitcast(args[0], _I8)
        # Counted from √½, so that the mantissa is halved where it is beyond √2.
        start = _each(0x3FE6A09E667F3BCD)
        above = builder.sub(bits, start)
        n = builder.ashr(above, _each(52))
        m = builder.bitcast(builder.sub(bits, builder.shl(n, _each(52))), _F8)
        return context.make_tuple(builder, sig.return_type, [m, builder.sitofp(n, _F8)])

    return types.UniTuple(lanes, 2)(lanes), code


_LN2_HIGH = 0.693147180369123816490
_LN2_LOW = 1.90821492927058770002e-10


@njit(inline="never", error_model="numpy")
def log(x):
    m, n = _parts(x)
    f = (m - 1.0) / (m + 1.0)
    u = f * f
    # 2 artanh(f)/f, |f| < 0.172: interpolated at Chebyshev points of u, 1e-18.
    s = u * 0.07405181319909711 + 0.07656230488116868
    s = s * u + 0.09091817198776582
    s = s * u + 0.11111098501112163
    s = s * u + 0.14285714380601372
    s = s * u + 0.19999999999649795
    s = s * u + 0.33333333333333826
    return n * _LN2_HIGH + ((2.0 * f) * (s * u) + n * _LN2_LOW + 2.0 * f)


_EIGHTH = math.tan(math.pi / 8)


@njit(inline="never", error_model="numpy")
def angle(y, x):
    ay, ax = size(y), size(x)
    low, high = less(ay, ax, ay, ax), less(ay, ax, ax, ay)
    # tan(θ − π/4) where tan θ is beyond tan π/8, so that |t| stays below that.
    turn = less(high * _EIGHTH, low, splat(1.0), splat(0.0))
    t = (low - turn * high) / (high + turn * low)
    u = t * t
    # atan(t)/t: interpolated at Chebyshev points of u, 2e-18.
    s = u * -0.017829184144146384 + 0.03798774160996723
    s = s * u - 0.05036020352571326
    s = s * u + 0.05847090096609891
    s = s * u - 0.06662982166188505
    s = s * u + 0.07692048125814824
    s = s * u - 0.09090896974391927
    s = s * u + 0.11111110751018727
    s = s * u - 0.14285714279381564
    s = s * u + 0.19999999999942342
    s = s * u - 0.33333333333333126
    theta = turn * (0.25 * math.pi) + (t * u * s + t)
    theta = less(ax, ay, 0.5 * math.pi - theta, theta)
    # Minus zero counts as negative only in y.
    theta = less(x, 0.0, math.pi - theta, theta)
    return signed(theta, y)
