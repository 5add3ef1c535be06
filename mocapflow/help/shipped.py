"""Where the pipelines and example recordings that come with mocapflow are."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path


def shipped(*parts: str) -> Path:
    """Return the path of a shipped file: inside the installed package, or in the checkout it is run from."""
    package = Path(str(files("mocapflow")))
    inside = package / "_shipped"
    return (inside if inside.is_dir() else package.parent).joinpath(*parts)
