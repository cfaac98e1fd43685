"""The tree in memory, as cpu/core/layout.h and compressed.h describe it, counted in words of 32 bits.

A child reference, masked by WORD_MASK, is the word at which the child begins: the reference holds the child's
unit times eight, and a unit is eight words.
"""

import warp as wp

UNIT_WORDS = 8
WORD_MASK = 0x7FFFFFF8
MAX_DEPTH = 64

# A node: six rows of planes, the children, the order. `upload` turns the core's order row, which has one word
# per lane, into eight bytes per octant, for octants 0 to 3: the i-th byte has a bit for each slot that comes
# behind slot i.
NODE_WIDTH = 8
NODE_WORDS = 8 * NODE_WIDTH
CHILD_ROW = 6 * NODE_WIDTH
BEHIND_ROW = 7 * NODE_WIDTH
ORDER_BITS = 4  # per octant, in the core's order row

# A compressed node: the grid's origin (three floats), a word with the exponents of its three steps and a
# bit per slot in use, six rows of eight bytes, the order as above, the children. The core's has the steps
# as floats and, behind the planes, an order row of three bytes per lane: `upload` rewrites nodes so that
# all of it can be read 16 bytes at a time.
COMPRESSED_NODE_WORDS = 32
COMPRESSED_PLANES = 4
COMPRESSED_BEHIND_ROW = 16
COMPRESSED_CHILD_ROW = 24
CORE_COMPRESSED_STEP = 3
CORE_COMPRESSED_PLANES = 6
CORE_COMPRESSED_ORDER = 18
CORE_COMPRESSED_ORDER_BITS = 3

# A block: nine rows of four numbers, row 3 k + axis for vertex k, and the prims; in float64 each number takes
# two words, and the block is padded to a multiple of 32 bytes.
BLOCK_WIDTH = 4
BLOCK_WORDS = 40
CORNER_WORDS = 3 * BLOCK_WIDTH  # from a corner's rows to the next one's, if numbers take one word
PRIM_ROW = 9 * BLOCK_WIDTH
MAX_LEAF_BLOCKS = 8

# A compressed block: x, y and z of its six or eight vertices, and a fourth word behind each: the prims behind
# vertices 0 to 3, the header's two words behind 4 and 5. These hold the corners' vertex numbers, 16 bits per
# corner, 4 bits per lane; above the third corner's are a bit per lane in use and the number of vertices. The
# core's has the header first, then rows of x, y and z, then the prims: `upload` rewrites it in place.
LEAST_COMPRESSED_WORDS = 24
VERTEX_WORDS = 4
EXTRA_WORD = 3  # of a vertex
HEADER_VERTEX = 4  # behind which the header begins
CORE_HEADER_WORDS = 2
CORNER_BITS = 16
NUMBER_BITS = 4
USED_SHIFT = 16
VERTICES_SHIFT = 20

# Zeros behind the tree on a device, as many as the largest leaf has words: a child that begins within the
# tree can be read, whatever overwrote it.
PADDING_WORDS = 2 * BLOCK_WORDS * MAX_LEAF_BLOCKS
MOST_VERTICES = wp.constant(wp.uint32(15))  # of a compressed block that was overwritten

END_OF_STACK = -1  # all bits set: a leaf by its sign
NO_PRIM = -1
ALL_BITS = wp.constant(wp.uint32(0xFFFFFFFF))
SIGN_BIT = wp.constant(wp.uint32(0x80000000))
