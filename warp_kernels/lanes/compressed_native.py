"""Native code that reads compressed nodes and blocks, on CUDA 16 bytes at a time.

Names that end in 8 or 4 are for lanes=8, one thread per ray; those in 1 for lanes=1, eight threads per ray.
"""

from wive.warp_kernels.lanes.layout import COMPRESSED_PLANES, NUMBER_BITS, VERTEX_WORDS
from wive.warp_kernels.lanes.native import load_16

# Four words of a node: the grid's origin, and a word with the exponents of its steps.
GRID = f"""
    const float* begin = (const float*)units + node;
#if defined(__CUDA_ARCH__)
    {load_16("f32", "begin")}
    return wp::vec_t<4, wp::float32>(words[0], words[1], words[2], words[3]);
#else
    return wp::vec_t<4, wp::float32>(begin[0], begin[1], begin[2], begin[3]);
#endif
"""
# A plane is a byte on the grid of its axis, so its distance is byte * (step * rdir) + (origin * rdir + bias).
# Distances of all near planes come first, then those of the far ones. `near_row` is the byte of the node at
# which the near planes begin: the high planes of an axis are behind its low ones.
_SLOPES = f"""
    enum {{ PLANES = {COMPRESSED_PLANES} }};
    const float* begin = (const float*)units + node;
    const wp::uint32 step_bits = wp::cast<wp::uint32>(grid[3]) << (23 - 8 * axis) & 0x7f800000u;
    const float step = wp::cast<float>(wp::uint32(step_bits));
    const float near_step = step * near_rdir, far_step = step * far_rdir;
#if defined(__CUDA_ARCH__)
    const float near_base = __fmaf_rn(grid[axis], near_rdir, near_bias);
    const float far_base = __fmaf_rn(grid[axis], far_rdir, far_bias);
#else
    const float near_base = grid[axis] * near_rdir + near_bias, far_base = grid[axis] * far_rdir + far_bias;
#endif
"""
BYTE_DISTANCES_8 = f"""
    {_SLOPES}
    wp::vec_t<16, wp::float32> distances;
#if defined(__CUDA_ARCH__)
    {load_16("u32", "begin + PLANES + 4 * axis")}
    const bool turned = (near_row & 8) != 0;
    for (int i = 0; i < 8; ++i) {{
        const unsigned low = words[i / 4], high = words[2 + i / 4];
        const unsigned near = turned ? high : low, far = turned ? low : high;
        // The byte behind the bits of 2^23, less 2^23: conversions have a fraction of the throughput.
        const unsigned byte = 0x7440u + i % 4;
        const float near_plane = __uint_as_float(__byte_perm(near, 0x4b000000u, byte)) - 8388608.0f;
        const float far_plane = __uint_as_float(__byte_perm(far, 0x4b000000u, byte)) - 8388608.0f;
        distances[i] = __fmaf_rn(near_plane, near_step, near_base);
        distances[8 + i] = __fmaf_rn(far_plane, far_step, far_base);
    }}
#else
    const unsigned char* near = (const unsigned char*)begin + near_row;
    const unsigned char* far = (const unsigned char*)begin + (near_row ^ 8);
    for (int i = 0; i < 8; ++i) distances[i] = (float)near[i] * near_step + near_base;
    for (int i = 0; i < 8; ++i) distances[8 + i] = (float)far[i] * far_step + far_base;
#endif
    return distances;
"""
BYTE_DISTANCES_1 = f"""
    {_SLOPES}
    const unsigned char* near = (const unsigned char*)begin + near_row + lane;
    const unsigned char* far = (const unsigned char*)begin + (near_row ^ 8) + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<2, wp::float32>(
        __fmaf_rn((float)__ldg(near), near_step, near_base),
        __fmaf_rn((float)__ldg(far), far_step, far_base));
#else
    return wp::vec_t<2, wp::float32>(
        (float)*near * near_step + near_base, (float)*far * far_step + far_base);
#endif
"""

# Corners from a block's vertices: the first axis of each triangle, then the second, then the third,
# `longest`. `numbers` holds the vertex numbers of four triangles; for one alone, that of triangle `lane`
# is taken.
_CORNERS = f"""
    // Bytes of a vertex are a power of two: a number that is shifted once says where its vertex begins.
    enum {{ BITS = {NUMBER_BITS}, SHIFT = {(4 * VERTEX_WORDS).bit_length() - 1} }};
    const char* const vertices = (const char*)((const float*)units + block);
    wp::vec_t<3 * LENGTH, wp::float32> corners;
    for (int i = 0; i < LENGTH; ++i) {{
        const int triangle = LENGTH == 1 ? lane & 3 : i;
        const float* from = (const float*)(vertices + (numbers << SHIFT >> BITS * triangle & 7u << SHIFT));
#if defined(__CUDA_ARCH__)
        {load_16("f32", "from")}
        corners[i] = longest == 0 ? words[1] : longest == 1 ? words[2] : words[0];
        corners[LENGTH + i] = longest == 0 ? words[2] : longest == 1 ? words[0] : words[1];
        corners[2 * LENGTH + i] = longest == 0 ? words[0] : longest == 1 ? words[1] : words[2];
#else
        corners[i] = from[longest == 2 ? 0 : longest + 1];
        corners[LENGTH + i] = from[longest == 0 ? 2 : longest - 1];
        corners[2 * LENGTH + i] = from[longest];
#endif
    }}
    return corners;
"""
CORNERS_4 = _CORNERS.replace("LENGTH", "4")
CORNERS_1 = _CORNERS.replace("LENGTH", "1")
