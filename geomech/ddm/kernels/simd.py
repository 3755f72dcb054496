"""SIMD types for Numba: vectors of eight real or complex numbers (lanes).

Compilers vectorise only loops that they can analyse. These types produce vector instructions directly: + − × ÷ of lanes
with lanes or a number, and the functions below. The result in a lane depends only on the inputs in that lane, not on
its position or the other lanes. Products and sums may be fused if the processor supports it.

    load(array, at)             real lanes at …, at + 7 of a flat array
    load_complex(array, at)     real parts first, imaginary parts behind them
    store(array, at, x)         either
    gather(array, at, places, first)        lane k from place at + places[first + k] of a flat array
    scatter(array, at, places, first, x)    lane k into that place
    pile(array, at, places, first, x)       lane k added to what is in that place
    splat(number)               the same in every lane
    both(x, y), re(z), im(z)    x + iy and its parts
    times_i(z)                  iz
    norm(z)                     |z|²
    less(a, b, x, y)            x where a < b, else y; real
    root(x), size(x)            √x, |x|; real
    signed(x, s)                |x| with the sign of s (that of a zero too)
    log(x), log1p(x)            of x > 0 normal, of x ≥ 0, within 2 ulp
    angle(y, x)                 atan2 within 2 ulp, with signed zeros, not of two zeros
    term(b, u, v, c), value(b, q)           a polynomial with real coefficients c at a complex point q

Kernels that use them are declared with `compiled.kept`, so that they are recompiled after changes here.
"""

from __future__ import annotations

import math
import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.errors import TypingError
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

from ...compiled import UNCOUNTED, part

WIDTH = 8

_F8 = ir.VectorType(ir.DoubleType(), WIDTH)
_I8 = ir.VectorType(ir.IntType(64), WIDTH)
#: Allows fused multiply-add and no other reordering.
_FUSE = ("contract",)


#: Real and imaginary parts.
_C8 = ir.ArrayType(_F8, 2)


class LanesType(types.Type):
    """Numba type of lanes: one vector, or two for complex numbers."""

    pass


lanes, complex_lanes = LanesType("Lanes"), LanesType("ComplexLanes")


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager, kind):
        super().__init__(manager, kind, _F8 if kind is lanes else _C8)


def _wide(builder, kind, value):
    """``value`` of Numba type ``kind`` in every lane; lanes are returned unchanged."""
    if kind is lanes:
        return value
    if isinstance(kind, types.Integer):
        value = builder.sitofp(value, ir.DoubleType())
    one = builder.insert_element(ir.Constant(_F8, ir.Undefined), value, ir.Constant(ir.IntType(32), 0))
    every = ir.Constant(ir.VectorType(ir.IntType(32), WIDTH), [0] * WIDTH)
    return builder.shuffle_vector(one, ir.Constant(_F8, ir.Undefined), every)


def _split(builder, kind, value):
    """Real and imaginary part, None where there is none."""
    if kind is complex_lanes:
        return builder.extract_value(value, 0), builder.extract_value(value, 1)
    return _wide(builder, kind, value), None


def _joined(builder, x, y):
    if y is None:
        return x
    out = builder.insert_value(ir.Constant(_C8, ir.Undefined), x, 0)
    return builder.insert_value(out, y, 1)


class _Arithmetic:
    """(real, imaginary) with (real, imaginary)."""

    def __init__(self, builder):
        self._builder = builder

    def plus(self, x, y):
        return self._builder.fadd(x, y, flags=_FUSE)

    def minus(self, x, y):
        return self._builder.fsub(x, y, flags=_FUSE)

    def times(self, x, y):
        return self._builder.fmul(x, y, flags=_FUSE)

    def add(self, a, b):
        (ar, ai), (br, bi) = a, b
        return self.plus(ar, br), (ai or bi) if None in (ai, bi) else self.plus(ai, bi)

    def sub(self, a, b):
        (ar, ai), (br, bi) = a, b
        if bi is None:
            return self.minus(ar, br), ai
        return self.minus(ar, br), self._builder.fneg(bi) if ai is None else self.minus(ai, bi)

    def mul(self, a, b):
        (ar, ai), (br, bi) = a, b
        if ai is None:
            return self.times(ar, br), bi if bi is None else self.times(ar, bi)
        if bi is None:
            return self.times(ar, br), self.times(ai, br)
        return (
            self.minus(self.times(ar, br), self.times(ai, bi)),
            self.plus(self.times(ar, bi), self.times(ai, br)),
        )

    def norm(self, a):
        return self.plus(self.times(a[0], a[0]), self.times(a[1], a[1]))

    def truediv(self, a, b):
        (ar, ai), (br, bi) = a, b
        if bi is None:
            by = self._builder.fdiv
            return by(ar, br), ai if ai is None else by(ai, br)
        one = ir.Constant(_F8, [1.0] * WIDTH)
        scale = self._builder.fdiv(one, self.norm(b))
        return self.mul(a, (self.times(br, scale), self._builder.fneg(self.times(bi, scale))))


_NUMBERS = (types.Float, types.Integer)


def _register(function):
    name = function.__name__

    @type_callable(function)
    def typer(context):
        def typed(a, b):
            if all(isinstance(k, (LanesType, *_NUMBERS)) for k in (a, b)) and any(
                isinstance(k, LanesType) for k in (a, b)
            ):
                return complex_lanes if complex_lanes in (a, b) else lanes
            return None

        return typed

    def lower(context, builder, sig, args):
        a, b = (_split(builder, kind, value) for kind, value in zip(sig.args, args))
        return _joined(builder, *getattr(_Arithmetic(builder), name)(a, b))

    both_kinds = (lanes, complex_lanes)
    pairs = [(a, b) for a in both_kinds for b in (*both_kinds, *_NUMBERS)]
    for pair in pairs + [(b, a) for a, b in pairs if b in _NUMBERS]:
        lower_builtin(function, *pair)(lower)


for _operator in (operator.add, operator.sub, operator.mul, operator.truediv):
    _register(_operator)


@type_callable(operator.neg)
def _negated(context):
    return lambda a: a if isinstance(a, LanesType) else None


@lower_builtin(operator.neg, lanes)
@lower_builtin(operator.neg, complex_lanes)
def _negate(context, builder, sig, args):
    x, y = _split(builder, sig.args[0], args[0])
    return _joined(builder, builder.fneg(x), y if y is None else builder.fneg(y))


@intrinsic
def both(typing, x, y):
    """x + i y of lanes x and y."""
    return complex_lanes(lanes, lanes), lambda context, builder, sig, args: _joined(builder, *args)


def _part(number: int):
    return lambda context, builder, sig, args: builder.extract_value(args[0], number)


@intrinsic
def re(typing, z):
    """The real parts."""
    return lanes(complex_lanes), _part(0)


@intrinsic
def im(typing, z):
    """The imaginary parts."""
    return lanes(complex_lanes), _part(1)


@intrinsic
def times_i(typing, z):
    """i z."""

    def code(context, builder, sig, args):
        x, y = _split(builder, complex_lanes, args[0])
        return _joined(builder, builder.fneg(y), x)

    return complex_lanes(complex_lanes), code


@intrinsic
def norm(typing, z):
    """|z|²."""

    def code(context, builder, sig, args):
        return _Arithmetic(builder).norm(_split(builder, complex_lanes, args[0]))

    return lanes(complex_lanes), code


@intrinsic
def term(typing, b, u, v, c):
    """From (b_{j+1}, b_{j+2}) the next (b_j, b_{j+1}), b_j = c_j + u b_{j+1} − v b_{j+2}, u = 2 Re q, v = |q|² (Knuth
    1981, §4.6.4): half the work of a complex Horner scheme, and as stable for |q| < 1."""

    def code(context, builder, sig, args):
        one, two = _split(builder, complex_lanes, args[0])
        _, u, v, c = (_wide(builder, kind, value) for kind, value in zip((lanes, *sig.args[1:]), args))
        do = _Arithmetic(builder)
        new = do.minus(do.plus(do.times(u, one), c), do.times(v, two))
        return _joined(builder, new, one)

    return complex_lanes(complex_lanes, lanes, lanes, types.float64), code


@intrinsic
def value(typing, b, q):
    """Σ c_j q^j from (b_0, b_1)."""

    def code(context, builder, sig, args):
        one, two = _split(builder, complex_lanes, args[0])
        x, y = _split(builder, complex_lanes, args[1])
        do = _Arithmetic(builder)
        return _joined(builder, do.minus(one, do.times(x, two)), do.times(y, two))

    return complex_lanes(complex_lanes, complex_lanes), code


def _first(context, builder, kind, array):
    """Address of the first number of a contiguous ``array``; others are refused: their numbers do not follow one another."""
    if kind.layout != "C":
        raise TypingError(
            f"a kernel reads numbers one after the other, but {kind} is not stored so: pass it by ascontiguousarray"
        )
    return context.make_array(kind)(context, builder, array).data


def _address(context, builder, kind, array, at):
    data = _first(context, builder, kind, array)
    return builder.bitcast(builder.gep(data, [at]), _F8.as_pointer())


def _at(builder, at, parts: int):
    """Addresses at which the ``parts`` of lanes begin."""
    return [builder.add(at, ir.Constant(at.type, WIDTH * k)) for k in range(parts)]


def _loading(kind, parts: int):
    def code(context, builder, sig, args):
        found = []
        for at in _at(builder, args[1], parts):
            found.append(builder.load(_address(context, builder, sig.args[0], args[0], at)))
            found[-1].align = 8
        return _joined(builder, *found, *[None] * (2 - parts))

    return lambda typing, array, at: (kind(array, types.intp), code)


@intrinsic
def load(typing, array, at):
    """Lanes of an ``array`` from the place ``at`` on."""
    return _loading(lanes, 1)(typing, array, at)


@intrinsic
def load_complex(typing, array, at):
    """Complex lanes: real parts, then imaginary ones."""
    return _loading(complex_lanes, 2)(typing, array, at)


@intrinsic
def store(typing, array, at, x):
    """Write lanes, real or complex, to an ``array`` from the place ``at`` on."""

    def code(context, builder, sig, args):
        found = [half for half in _split(builder, sig.args[2], args[2]) if half is not None]
        for place, half in zip(_at(builder, args[1], len(found)), found):
            builder.store(half, _address(context, builder, sig.args[0], args[0], place), align=8)
        return context.get_dummy_value()

    return types.none(array, types.intp, x), code


def _addresses(context, builder, sig, array, at, places, first):
    """Address of each lane in turn."""
    data = builder.gep(_first(context, builder, sig.args[0], array), [at])
    places = builder.gep(_first(context, builder, sig.args[2], places), [first])
    for k in range(WIDTH):
        place = builder.load(builder.gep(places, [ir.Constant(ir.IntType(64), k)]))
        yield ir.Constant(ir.IntType(32), k), builder.gep(data, [place])


@intrinsic
def gather(typing, array, at, places, first):
    """Lane k from ``array[at + places[first + k]]``."""

    def code(context, builder, sig, args):
        out = ir.Constant(_F8, ir.Undefined)
        for k, address in _addresses(context, builder, sig, *args):
            out = builder.insert_element(out, builder.load(address), k)
        return out

    return lanes(array, types.intp, places, types.intp), code


@intrinsic
def scatter(typing, array, at, places, first, x):
    """Write lane k to ``array[at + places[first + k]]``."""

    def code(context, builder, sig, args):
        for k, address in _addresses(context, builder, sig, *args[:4]):
            builder.store(builder.extract_element(args[4], k), address)
        return context.get_dummy_value()

    return types.none(array, types.intp, places, types.intp, lanes), code


@intrinsic
def pile(typing, array, at, places, first, x):
    """Add lane k to ``array[at + places[first + k]]``; lanes with the same address must hold the same number."""

    def code(context, builder, sig, args):
        # All reads before the writes, so that lanes with the same address write the same sum.
        found = [(k, address, builder.load(address)) for k, address in _addresses(context, builder, sig, *args[:4])]
        for k, address, old in found:
            builder.store(builder.fadd(old, builder.extract_element(args[4], k)), address)
        return context.get_dummy_value()

    return types.none(array, types.intp, places, types.intp, lanes), code


@intrinsic
def splat(typing, number):
    """Lanes of one ``number``."""
    return lanes(types.float64), lambda context, builder, sig, args: _wide(builder, types.float64, args[0])


@intrinsic
def less(typing, a, b, x, y):
    """x where a < b, else y."""

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
    """Square roots."""
    return lanes(lanes), _by_llvm("sqrt", 1)


@intrinsic
def size(typing, x):
    """Absolute values."""
    return lanes(lanes), _by_llvm("fabs", 1)


@intrinsic
def signed(typing, x, s):
    """|``x``| with the sign of ``s``."""
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


@part(error_model="numpy", **UNCOUNTED)
def log(x):
    """Natural logarithms."""
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


@part(error_model="numpy", **UNCOUNTED)
def log1p(x):
    """log(1 + x)."""
    whole = 1.0 + x
    return log(whole) + (x - (whole - 1.0)) / whole


_EIGHTH = math.tan(math.pi / 8)


@part(error_model="numpy", **UNCOUNTED)
def angle(y, x):
    """atan2(y, x)."""
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
