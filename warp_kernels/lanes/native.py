"""Native code of the lane vectors: intrinsics on CUDA, plain C++ on Warp's CPU device.

Names that end in 8 or 4 are for lanes=8, one thread per ray; those in 1 for lanes=1, eight threads per ray.
"""

from wive.warp_kernels.lanes.layout import CORNER_WORDS


def load_16(kind: str, address: str, byte: int = 0) -> str:
    """CUDA code that declares words[4] of `kind` and loads them from an address.

    As __ldg, but compilers may merge equal loads, and `byte` is part of the instruction.
    """
    constraint = {"f32": "=f", "u32": "=r"}[kind]
    type_name = {"f32": "float", "u32": "unsigned"}[kind]
    outputs = ", ".join(f'"{constraint}"(words[{i}])' for i in range(4))
    return f"""
    {type_name} words[4];
    asm("ld.global.nc.v4.{kind} {{%0, %1, %2, %3}}, [%4+{byte}];" : {outputs} : "l"({address}));
"""


# The address of a row that begins at a byte of a node, by one instruction on CUDA.
ROW_ADDRESS = """
    wp::uint64 address = (wp::uint64)((const float*)units + node);
#if defined(__CUDA_ARCH__)
    asm("mad.wide.u32 %0, %1, 1, %0;" : "+l"(address) : "r"(row));
#else
    address += row;
#endif
"""
# Distances from the ray's origin to a row of planes: plane * rdir + bias, fused on CUDA, where a row is two
# loads of 16 bytes.
DISTANCES_8 = (
    (
        ROW_ADDRESS
        + """
    wp::vec_t<8, wp::float32> distances;
#if defined(__CUDA_ARCH__)
    { LOW for (int i = 0; i < 4; ++i) distances[i] = __fmaf_rn(words[i], rdir, bias); }
    { HIGH for (int i = 0; i < 4; ++i) distances[4 + i] = __fmaf_rn(words[i], rdir, bias); }
#else
    LANES
    *(lanes*)&distances = *(const lanes*)address * rdir + bias;
#endif
    return distances;
"""
    )
    .replace("LOW", load_16("f32", "address"))
    .replace("HIGH", load_16("f32", "address", 16))
)
DISTANCES_1 = (
    ROW_ADDRESS
    + """
    const float* plane = (const float*)address + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::float32>(__fmaf_rn(__ldg(plane), rdir, bias));
#else
    return wp::vec_t<1, wp::float32>(*plane * rdir + bias);
#endif
"""
)


# A byte of a word, which CUDA takes out in one instruction.
BYTE_OF = """
#if defined(__CUDA_ARCH__)
    return (int)__byte_perm(word, 0u, 0x4440u + i);
#else
    return (int)(word >> 8 * i & 255u);
#endif
"""

# A row of words of a node, for its children.
ROW_8 = """
    const wp::uint32* row = (const wp::uint32*)units + node;
    wp::vec_t<8, wp::uint32> found;
#if defined(__CUDA_ARCH__)
    { LOW for (int i = 0; i < 4; ++i) found[i] = words[i]; }
    { HIGH for (int i = 0; i < 4; ++i) found[4 + i] = words[i]; }
#else
    for (int i = 0; i < 8; ++i) found[i] = row[word + i];
#endif
    return found;
""".replace("LOW", load_16("u32", "row + word")).replace("HIGH", load_16("u32", "row + word", 16))
ROW_1 = """
    const wp::uint32* row = (const wp::uint32*)units + node + word + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<1, wp::uint32>(__ldg(row));
#else
    return wp::vec_t<1, wp::uint32>(*row);
#endif
"""

# The slots behind each slot, as bytes: two words of one octant, or the byte of the lane's own slot.
BEHIND_8 = (
    ROW_ADDRESS
    + """
#if defined(__CUDA_ARCH__)
    const uint2 a = __ldg((const uint2*)address);
    return wp::vec_t<2, wp::uint32>(a.x, a.y);
#else
    const wp::uint32* words = (const wp::uint32*)address;
    return wp::vec_t<2, wp::uint32>(words[0], words[1]);
#endif
"""
)
BEHIND_1 = (
    ROW_ADDRESS
    + """
    const unsigned char* byte = (const unsigned char*)address + lane;
#if defined(__CUDA_ARCH__)
    return wp::vec_t<2, wp::uint32>(__ldg(byte), 0u);
#else
    return wp::vec_t<2, wp::uint32>(*byte, 0u);
#endif
"""
)

# The address of an axis' row in a block, from the word at which the first axis' begins, by one instruction on
# CUDA.
BLOCK_ROW = """
    wp::uint64 address = (wp::uint64)((const float*)units + at);
#if defined(__CUDA_ARCH__)
    asm("mad.wide.u32 %0, %1, BYTES, %0;" : "+l"(address) : "r"(axis));
#else
    address += BYTES * (wp::uint64)axis;
#endif
    return address;
"""
# The numbers of a block's four triangles, in the row of the k-th corner behind that of the first.
TRIANGLES_4 = """
    const float* numbers = (const float*)row + CORNER_WORDS * k;
#if defined(__CUDA_ARCH__)
    // k is known to the compiler, but has to be part of the instruction.
    const float* address = (const float*)row;
    wp::vec_t<4, wp::float32> found;
    if (k == 0) { FIRST for (int i = 0; i < 4; ++i) found[i] = words[i]; }
    if (k == 1) { SECOND for (int i = 0; i < 4; ++i) found[i] = words[i]; }
    if (k == 2) { THIRD for (int i = 0; i < 4; ++i) found[i] = words[i]; }
    return found;
#else
    LANES
    wp::vec_t<4, wp::float32> found;
    *(lanes*)&found = *(const lanes*)numbers;
    return found;
#endif
"""
for _k, _name in enumerate(("FIRST", "SECOND", "THIRD")):
    TRIANGLES_4 = TRIANGLES_4.replace(_name, load_16("f32", "address", 4 * CORNER_WORDS * _k))
TRIANGLES_4 = TRIANGLES_4.replace("CORNER_WORDS", str(CORNER_WORDS))
DOUBLE_TRIANGLES_4 = f"""
    const double* numbers = (const double*)row + {CORNER_WORDS} * k;
#if defined(__CUDA_ARCH__)
    const double2 a = __ldg((const double2*)numbers), b = __ldg((const double2*)numbers + 1);
    return wp::vec_t<4, wp::float64>(a.x, a.y, b.x, b.y);
#else
    LANES
    wp::vec_t<4, wp::float64> found;
    *(lanes*)&found = *(const lanes*)numbers;
    return found;
#endif
"""

# Refuses modules whose options let the compiler round otherwise: hits would not be the core's.
ROUNDED_AS_WRITTEN = """
#if (defined(__CUDA_FTZ) && __CUDA_FTZ) || defined(__FAST_MATH__)
#error "wive: compile this kernel's module with fast_math=False: fast_math changes which triangles are hit"
#endif
"""

# Products that no compiler may fuse with an addition, whatever options the module is compiled with: fused,
# the two triangles at an edge would not compute the same numbers.
PRODUCT = """
#if defined(__CUDA_ARCH__)
    return ROUNDED(a, b);
#else
    return a * b;
#endif
"""
PRODUCTS = """
    wp::vec_t<LENGTH, wp::REAL> c;
#if defined(__CUDA_ARCH__)
    for (int i = 0; i < LENGTH; ++i) c[i] = ROUNDED(a[i], b[i]);
#else
    LANES
    *(lanes*)&c = *(const lanes*)&a * *(const lanes*)&b;
#endif
    return c;
"""

# On the CPU device one instruction, which takes a fifth of the time of a maximum that passes over NaN.
LARGER = """
#if defined(__CUDA_ARCH__)
    return wp::max(a, b);
#else
    return a > b ? a : b;
#endif
"""

# x1 y2 - y1 x2 with the exact sign, as cpu/traverse/triangle_watertight_float64.h.
EXACT_WEIGHT = """
#if defined(__CUDA_ARCH__)
    const double a = __dmul_rn(x1, y2), b = __dmul_rn(y1, x2);
#else
    const double a = x1 * y2, b = y1 * x2;
#endif
    const double a_low = fma(x1, y2, -a), b_low = -fma(y1, x2, -b);
    const double low = a_low + b_low, b_part = low - a_low;
    const double lowest = (a_low - (low - b_part)) + (b_low - b_part);
    return ((a - b) + low) + lowest;
"""

# Writes a hit to the last free one of the ray's places and counts `remaining` down. The count never falls
# below zero: memory stays intact even if the rays were overwritten since their hits were counted. On the CPU
# device the fibers of a ray run one at a time, so no atomics are needed.
LIST_HIT = """
#if defined(__CUDA_ARCH__)
    const int place = atomicSub((int*)remaining, 1) - 1;
    if (place < 0) { atomicAdd((int*)remaining, 1); return; }
#else
    if (*(const int*)remaining <= 0) return;
    const int place = --*(int*)remaining;
#endif
    REAL* hit = (REAL*)hits + 4 * (wp::int64)place;
    hit[0] = t;
    hit[1] = u;
    hit[2] = v;
    *(int*)(hit + 3) = prim;
"""


# An element of an array. On CUDA the product is one instruction, which compilers do not split: strides in 64
# bits, computed before a loop, would take two registers each for the whole of a kernel.
_ELEMENT = """
#if defined(__CUDA_ARCH__)
    wp::int64 offset;
    asm("mul.wide.s32 %0, %1, %2;" : "=l"(offset) : "r"(i), "r"((int)values.strides[0]));
#else
    const wp::int64 offset = (wp::int64)i * values.strides[0];
#endif
    TYPE* element = (TYPE*)((char*)values.data + offset);
"""
READ_ELEMENT = _ELEMENT + "    return *element;"
WRITE_ELEMENT = _ELEMENT + "    *element = value;"


# A stack as an array of words: a thread's own, or the address of a group's.
STACK_8 = """
    typedef unsigned __attribute__((may_alias)) word_of_stack;
    word_of_stack* const words = (word_of_stack*)&stack;
"""
STACK_1 = """
    typedef unsigned __attribute__((may_alias)) word_of_stack;
    word_of_stack* const words = (word_of_stack*)stack;
"""


def shared_stack_code(words: int) -> str:
    """Native code for the address of a group's stack of `words`, in memory that its block shares."""
    return f"""
#if defined(__CUDA_ARCH__)
    __shared__ unsigned stack[(WP_TILE_BLOCK_DIM + 7) / 8][{words}];
    return (wp::uint64)&stack[threadIdx.x >> 3][0];
#else
    static unsigned stack[(WP_TILE_BLOCK_DIM + 7) / 8][{words}];
    return (wp::uint64)&stack[WP_TILE_THREAD_IDX >> 3][0];
#endif
"""
