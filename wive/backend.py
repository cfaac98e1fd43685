"""Which backends there are, which of them this machine can run, and how many threads it has for them."""

import os
from dataclasses import dataclass

from wive import _cpu
from wive.arguments import choice

CPU_BACKENDS = ("avx512", "avx2", "scalar")


@dataclass(frozen=True)
class Backend:
    """What `wive.backends()` says of one backend: usable or not, and if not, why and how to mend it."""

    usable: bool
    reason: str = ""


def backends() -> dict[str, Backend]:
    """Every backend by name, best CPU backend first; `reason` is empty where `usable` is true."""
    kernels = _cpu.kernels()
    found = {}
    for name in CPU_BACKENDS:
        reason = kernels.get(name, "not compiled into this build of wive: it needs an x86-64 compiler")
        found[name] = Backend(usable=not reason, reason=reason)
    found["warp"] = Backend(usable=False, reason="not part of this version of wive: choose a CPU backend")
    return found


def resolve_backend(name: str) -> str:
    """The usable backend meant by `name`; "auto" is the first usable one.

    Raises ValueError where there is no such backend or this machine can't run it.
    """
    found = backends()
    usable = [candidate for candidate, backend in found.items() if backend.usable]
    choice("backend", name, ("auto", *found))
    if name == "auto":
        return usable[0]
    if name not in usable:
        raise ValueError(
            f"backend {name!r} can't run here ({found[name].reason}); "
            f"choose one of {', '.join(['auto', *usable])}"
        )
    return name


def available_threads() -> int:
    """The number of cores this process may run on."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
