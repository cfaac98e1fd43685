"""Section `basics`: cycles of the warp collectives and of the loads that a traversal is made of."""

# mypy: disable-error-code="untyped-decorator, empty-body"

from typing import Any

import numpy as np
import warp as wp

from bench.gpu.session import Session
from bench.support.report import Row

STEPS = 256  # measured operations per thread
GROUP = (
    "const unsigned group = 0xffu << (threadIdx.x & 24u);"  # the eight threads of a ray with one lane each
)
# Each works on x and the step's number i, over a group of eight threads or over the whole warp.
COLLECTIVES = {
    "redux or, group": f"{GROUP} x = __reduce_or_sync(group, x) + i;",
    "shuffle or, group": f"{GROUP} unsigned y = x; "
    "for (int k = 4; k; k >>= 1) y |= __shfl_xor_sync(group, y, k, 8); x = y + i;",
    "ballot, group": f"{GROUP} x = __ballot_sync(group, x & 1u) + i;",
    "syncwarp, group": f"{GROUP} __syncwarp(group); x += i;",
    "redux or, warp": "x = __reduce_or_sync(0xffffffffu, x) + i;",
    "shuffle or, warp": "unsigned y = x; "
    "for (int k = 4; k; k >>= 1) y |= __shfl_xor_sync(0xffffffffu, y, k, 8); x = y + i;",
    "ballot, warp": "x = (__ballot_sync(0xffffffffu, x & 1u) >> (threadIdx.x & 24u) & 255u) + i;",
    "syncwarp, warp": "__syncwarp(); x += i;",
    "nothing": "x = x * 3u + i;",
}
COLLECTIVE_WARPS = (1, 8)

# Type and index of the element that a thread loads in step i, from 64 KiB that L1 holds.
LOADS = {
    "16 bytes, 32 lines": ("float4", "(lane * 37u + i * 5u & 511u) * 8u"),
    "16 bytes, 8 lines": ("float4", "((lane >> 2) * 37u + i * 5u & 511u) * 8u + (lane & 3u)"),
    "16 bytes, 4 lines (coalesced)": ("float4", "(i * 4u & 508u) * 8u + lane"),
    "16 bytes, 1 line": ("float4", "(i * 5u & 511u) * 8u"),
    "8 bytes, 32 lines": ("float2", "(lane * 37u + i * 5u & 511u) * 16u"),
    "4 bytes, 32 lines": ("float", "(lane * 37u + i * 5u & 511u) * 32u"),
    "4 bytes, 1 line (coalesced)": ("float", "(i * 5u & 511u) * 32u + lane"),
    "twice 16 bytes of the same 32 lines": ("float4", "(lane * 37u + (i >> 1) * 5u & 511u) * 8u + (i & 1u)"),
}
LOADED_FLOATS = 16 * 1024
LOAD_WARPS = 24

COLLECTIVE_CODE = """
#if defined(__CUDA_ARCH__)
    unsigned x = seed;
    const long long begin = clock64();
    #pragma unroll 1
    for (unsigned i = 0; i < %(steps)du; ++i) { %(code)s }
    const long long end = clock64();
    return (wp::uint64)(end - begin) << 16 | (x & 0xffffu);  // x, so that it is not optimised away
#else
    return 0;
#endif
"""
LOAD_CODE = """
#if defined(__CUDA_ARCH__)
    const %(kind)s* data = (const %(kind)s*)address;
    const unsigned lane = threadIdx.x & 31u;
    float sum = 0.0f;
    for (unsigned i = 0; i < 512u; ++i) sum += ((const float*)address)[i * 32u];  // one per line: into L1
    __syncthreads();
    const long long begin = clock64();
    #pragma unroll 8
    for (unsigned i = 0; i < %(steps)du; ++i) {
        const %(kind)s value = __ldg(data + (%(place)s));
        sum += %(first)s;
    }
    const long long end = clock64();
    return (wp::uint64)(end - begin) + (sum == 1.0f ? 1 : 0);
#else
    return 0;
#endif
"""


def run(session: Session) -> Row:
    """A row per operation: cycles of one, by warps at work; of loads, cycles of the multiprocessor."""
    if not session.on_gpu:
        return {"left out": "cycles of a GPU"}
    rows: list[Row] = []
    for name, code in COLLECTIVES.items():
        kernel = collective_kernel(code)
        for warps in COLLECTIVE_WARPS:
            out = wp.zeros(32 * warps, dtype=wp.uint64, device=session.device)
            for _ in range(2):  # the first launch warms up
                wp.launch(kernel, len(out), [out], device=session.device, block_dim=len(out))
            cycles = np.median(out.numpy() >> np.uint64(16)) / STEPS
            rows.append({"operation": name, "warps": warps, "cycles": round(float(cycles), 1)})
    data = wp.zeros(LOADED_FLOATS, dtype=wp.float32, device=session.device)
    for name, (kind, place) in LOADS.items():
        kernel = load_kernel(kind, place)
        out = wp.zeros(32 * LOAD_WARPS, dtype=wp.uint64, device=session.device)
        for _ in range(3):
            inputs = [wp.uint64(data.ptr), out]
            wp.launch(kernel, len(out), inputs, device=session.device, block_dim=len(out))
        cycles = np.median(out.numpy()) / STEPS / LOAD_WARPS
        rows.append({"operation": f"load {name}", "warps": LOAD_WARPS, "cycles": round(float(cycles), 2)})
    for row in rows:
        print("basics", row, flush=True)
    return {"steps": STEPS, "rows": rows}


def collective_kernel(code: str) -> Any:
    """A kernel that writes the cycles of all steps, shifted left by 16 bits."""

    @wp.func_native(COLLECTIVE_CODE % {"steps": STEPS, "code": code})
    def measured(seed: wp.uint32) -> wp.uint64: ...

    @wp.kernel(module="unique", enable_backward=False)
    def probe(out: wp.array(dtype=wp.uint64)):  # type: ignore[valid-type, no-untyped-def]
        i = wp.tid()
        out[i] = measured(wp.uint32(i))

    return probe


def load_kernel(kind: str, place: str) -> Any:
    """A kernel that writes the cycles of all steps."""
    first = "value" if kind == "float" else "value.x"

    @wp.func_native(LOAD_CODE % {"steps": STEPS, "kind": kind, "place": place, "first": first})
    def measured(address: wp.uint64) -> wp.uint64: ...

    @wp.kernel(module="unique", enable_backward=False)
    def probe(address: wp.uint64, out: wp.array(dtype=wp.uint64)):  # type: ignore[valid-type, no-untyped-def]
        i = wp.tid()
        out[i] = measured(address)

    return probe
