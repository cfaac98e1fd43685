"""Where the large scenes are."""

from pathlib import Path

SCENES = Path(__file__).resolve().parents[3] / "shared" / "scenes"
