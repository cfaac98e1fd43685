"""Runs the CUDA code of Warp kernels without a GPU, and checks how its threads work together.

`wp.compile_aot_module` writes the PTX that a GPU would get (launching.py). Each PTX instruction becomes a
statement of C++ (parsing.py, instructions.py, translation.py), and each thread of a warp a fiber of the host
(machine.h, machine.cpp). The fibers run in an order drawn at random, as CUDA's independent thread scheduling
allows, and switch at instructions that threads run together and at accesses to shared memory.

These are errors:

- a race: two threads access a word of shared memory, one writes it, and no `bar.warp.sync` lies between;
- a mask that does not name its own thread, or threads that meet at different instructions;
- a deadlock: threads wait for others that never arrive;
- a load or store that is not aligned;
- an instruction that is not known here, such as one that rounds otherwise.

The tests run kernels in this way. `python -m bench gpu_model` counts what their warps do (blocks.py,
model.py, model.cpp).

Not covered: the assembler behind PTX, memory orders weaker than one access at a time, races between warps.
"""

from bench.ptx.launching import HostKernel, MachineError, host_kernel, on_the_host

__all__ = ["HostKernel", "MachineError", "host_kernel", "on_the_host"]
