"""The limits of a ray in the units of its frame, as cpu/traverse/scaled_limits.h."""

import warp as wp

from wive.warp_kernels.lanes.precision import PRECISIONS

# Per precision: the unsigned word of a number's size, its sign bit, the bits of infinity, and the numbers
# between which scaling by a power of two is exact.
WORDS = {
    "float32": (wp.uint32, 1 << 31, 0x7F800000, 2.0**-125, 3.4028234663852886e38),
    "float64": (wp.uint64, 1 << 63, 0x7FF0000000000000, 2.0**-1021, 1.7976931348623157e308),
}


def make_scale_limits(precision: str) -> wp.Function:
    """The function that scales the limits of a ray of this precision."""
    real, vec2 = PRECISIONS[precision].real, PRECISIONS[precision].vec2
    word, sign_bit, infinity_bits, least_number, most_number = WORDS[precision]
    sign, one, zero = word(sign_bit), word(1), real(0.0)
    # In the order of all numbers -infinity is at place 0.
    first, last = word(sign_bit - 1 - infinity_bits), word(2 * infinity_bits + 1)
    least, most = real(least_number), real(most_number)

    @wp.func
    def number_at(place: word):
        """The number at a place in the order of all numbers."""
        bits = place + first
        return wp.cast(wp.where((bits & sign) != word(0), bits ^ sign, ~bits), real)

    @wp.func(inline=False)
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
