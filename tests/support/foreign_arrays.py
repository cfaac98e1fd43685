"""Arrays of a library that wive does not know by name."""

import numpy as np


class Foreign:
    """A library that supports DLPack and nothing else, over NumPy's memory."""

    __name__ = "foreign.api"

    class Array:
        """One of its arrays; `place` is its DLPack device."""

        def __init__(self, values, place=(1, 0)):
            self.values, self.place = np.asarray(values), place

        def __array_namespace__(self):
            return Foreign()

        def __dlpack__(self, **options):
            try:
                return self.values.__dlpack__(**options)
            except BufferError:  # NumPy before 2.1 doesn't export read-only arrays, as libraries do
                return self.values.copy().__dlpack__(**options)

        def __dlpack_device__(self):
            return self.place

    def from_dlpack(self, source):
        return self.Array(np.from_dlpack(source))
