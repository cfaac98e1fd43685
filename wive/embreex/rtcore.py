"""The device of embreex's scenes."""

from wive.backend import resolve_backend


class EmbreeDevice:
    """What scenes may be made with; it holds nothing."""

    def __repr__(self) -> str:
        """The version of wive and the backend that traces."""
        from wive import __version__

        return f"wive version:  {__version__}, backend {resolve_backend('auto')[0]}"
