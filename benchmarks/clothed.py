"""The pipeline for what a recording's person wears."""

from __future__ import annotations

import json
from pathlib import Path

from mocapflow.help.shipped import shipped


def pipeline_for(recording: Path) -> Path:
    """Return the shipped pipeline of the garment that a recording describes: skirt.yaml or shorts.yaml."""
    garment = json.loads((recording / "subject" / "garment.json").read_text())["type"]
    return shipped("pipelines", f"{garment}.yaml")
