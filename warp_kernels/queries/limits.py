"""The limits of a ray in the units of its frame, as cpu/traverse/scaled_limits.h."""

import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS

# Per precision: the unsigned word of a number's size, its sign bit, the bits of infinity, and the numbers
# between which scaling by a power of two is exact.
WORDS = {
    "float32": (wp.uint32, 1 << 31, 0x7F800000, 2.0**-125, 3.4028234663852886e38),
    "float64": (wp.uint64, 1 << 63, 0x7FF0000000000000, 2.0**-1021, 1.7976931348623157e308),
}


@wp.func
def next_above(x: float):
    """The next number above x, which is not infinity."""
    bits = wp.cast(x, wp.int32)
    smallest = wp.cast(1, wp.float32)
    return wp.where(x == 0.0, smallest, wp.cast(wp.where(bits < 0, bits - 1, bits + 1), wp.float32))


def make_largest_within(precision: str) -> wp.Function:
    """The function (limit, unscale) that returns the largest t with t / unscale, rounded, not above limit."""
    return _largest_within if precision == "float32" else _make_search(precision)


# Numbers from here on round to infinity in float32.
OVERFLOW = wp.constant(wp.float64(2.0**128 - 2.0**103))


@wp.func
def _largest_within(limit: float, unscale: float):
    # Doubles hold the middle between two floats, and its product with a power of two, exactly. (The search of
    # float64, which has no wider type, takes six registers more.)
    if limit == wp.inf:
        return limit
    above = next_above(limit)
    middle = wp.float64(0.5) * (wp.float64(limit) + wp.float64(above))
    if limit == -wp.inf:
        middle = -OVERFLOW
    if above == wp.inf:
        middle = OVERFLOW
    # A middle is rounded to the even one of its neighbours; -infinity counts as even.
    takes_middle = limit == -wp.inf or (wp.cast(limit, wp.uint32) & wp.uint32(1)) == wp.uint32(0)
    product = middle * wp.float64(unscale)
    t = wp.float32(product)
    if wp.float64(t) > product or (wp.float64(t) == product and not takes_middle):
        t = -next_above(-t)
    return t


def _make_search(precision: str) -> wp.Function:
    real = PRECISIONS[precision].real
    word, sign_bit, infinity_bits, least_number, most_number = WORDS[precision]
    sign, one = word(sign_bit), word(1)
    # In the order of all numbers -infinity is at place 0.
    first, last = word(sign_bit - 1 - infinity_bits), word(2 * infinity_bits + 1)
    least, most = real(least_number), real(most_number)

    @wp.func
    def number_at(place: word):
        """The number at a place in the order of all numbers."""
        bits = place + first
        return wp.cast(wp.where((bits & sign) != word(0), bits ^ sign, ~bits), real)

    @wp.func
    def largest_within(limit: real, unscale: real):
        """The largest t with t / unscale <= limit."""
        product = limit * unscale
        smaller = wp.min(wp.abs(limit), wp.abs(product))
        larger = wp.max(wp.abs(limit), wp.abs(product))
        if limit > most or (smaller >= least and larger <= most):
            return product
        low = word(0)
        high = word(last)
        while low < high:
            middle = high - ((high - low) >> one)
            if number_at(middle) / unscale <= limit:
                low = middle
            else:
                high = middle - one
        return number_at(low)

    return largest_within


def make_scale_limits(precision: str) -> wp.Function:
    """The function that scales the limits of a ray of this precision."""
    real, vec2 = PRECISIONS[precision].real, PRECISIONS[precision].vec2
    _, _, _, least_number, most_number = WORDS[precision]
    zero, least, most = real(0.0), real(least_number), real(most_number)
    largest_within = make_largest_within(precision)

    @wp.func
    def scale_limits(tmin: real, tmax: real, unscale: real):
        """The t of the frame for which t / unscale, rounded as it is returned, lies in [tmin, tmax]."""
        near = tmin * unscale
        far = tmax * unscale
        exact = tmax >= least and far >= least
        exact = exact and (tmin == zero or (tmin >= least and near >= least and near <= most))
        if not exact:
            near = wp.where(tmin == zero, zero, -largest_within(-tmin, unscale))
            far = largest_within(tmax, unscale)
        return vec2(near, far)

    return scale_limits
