"""Which backends there are, and which of them this machine can run."""

from __future__ import annotations

from dataclasses import dataclass

from wive import _cpu
from wive._internal.arguments import choice
from wive._internal.devices import resolve_device, warp_devices, warp_problem
from wive._internal.scalars import shown

CPU_BACKENDS = ("avx512", "avx2", "scalar")
WARP = "warp"


@dataclass(frozen=True)
class Backend:
    """What `wive.backends()` says of one backend: usable or not, and if not, why and how to mend it."""

    usable: bool
    reason: str = ""

    @property
    def devices(self) -> dict[str, Backend]:
        """The backend's devices by name, each usable or not; none for CPU backends."""
        return {}

    @property
    def form(self) -> str:
        """The form of the slab test, if the backend has two and is usable; else empty."""
        return ""


class Avx512Backend(Backend):
    """The backend that uses the better of two forms; on some machines, `form` races them first."""

    @property
    def form(self) -> str:
        """ "full" or "half": the faster one on this machine, or as WIVE_AVX512_FORM says."""
        return _cpu.avx512_form() if self.usable else ""


class WarpBackend(Backend):
    """The backend that has devices; listing them starts Warp."""

    @property
    def devices(self) -> dict[str, Backend]:
        """Warp's devices by name; the first usable one is the default."""
        if not self.usable:
            return {}
        return {name: Backend(not reason, reason) for name, reason in warp_devices().items()}


def backends() -> dict[str, Backend]:
    """Every backend by name, best CPU backend first; `reason` is empty if `usable` is true."""
    kernels = _cpu.kernels()
    found = {}
    for name in CPU_BACKENDS:
        reason = kernels.get(name, "not compiled into this build of wive: it needs an x86-64 compiler")
        kind = Avx512Backend if name == "avx512" else Backend
        found[name] = kind(usable=not reason, reason=reason)
    reason = warp_problem()
    found[WARP] = WarpBackend(usable=not reason, reason=reason)
    return found


# What to pass instead of a kind of device for a backend.
PLACES = {"cpu": ": 'auto' is the fastest on the CPU"}
PLACES |= dict.fromkeys(("cuda", "gpu"), ": device 'cuda:0' is the first GPU")


def resolve_backend(name: str, device: str | None = None) -> tuple[str, str | None]:
    """The usable backend and device meant; "auto" is the first usable CPU backend, and with a device Warp.

    The device of a CPU backend is None. Raises ValueError or TypeError if there is no such backend or device
    or this machine can't run it.
    """
    try:
        choice("backend", name, ("auto", *CPU_BACKENDS, WARP))
    except ValueError as error:
        raise ValueError(f"{error}{PLACES.get(str(name).partition(':')[0], '')}") from None
    if device is not None:
        if not isinstance(device, str):
            raise TypeError(f"device must be a name such as 'cpu' or 'cuda:0', got {shown(device)}")
        if name not in ("auto", WARP):
            raise ValueError(
                f"device is only for backend 'warp', got device {device!r} with backend {name!r}: "
                "leave one of them out"
            )
        name = WARP
    if name != WARP:  # without a look at Warp's version, which takes longer than building a small scene
        kernels = _cpu.kernels()
        candidates = CPU_BACKENDS if name == "auto" else (name,)
        for name in candidates:
            if kernels.get(name) == "":
                return name, None
    found = backends()
    if not found[name].usable:
        usable = [candidate for candidate, backend in found.items() if backend.usable]
        raise ValueError(
            f"backend {name!r} can't run here ({found[name].reason}); "
            f"choose one of {', '.join(['auto', *usable])}"
        )
    return name, resolve_device(device)
