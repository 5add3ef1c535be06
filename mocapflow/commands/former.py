"""What a run folder holds of a former run: no figure may pass for one of another run."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from pathlib import Path

FORMER = "former"


def has_results(out: Path) -> bool:
    """Return whether a run has been finished in a run folder."""
    from mocapflow_export import layout

    return (out / layout.RUN).is_file()


def differing(out: Path, keys: Mapping[str, str]) -> list[str]:
    """Return the stages whose results in a run folder were made otherwise than by these keys; none if there are none.

    Args:
        out: the run folder.
        keys: stage by stage, of a run as it would be now.
    """
    from mocapflow_export import layout

    try:
        made = json.loads((out / layout.RUN).read_text(encoding="utf-8"))["recipe"]["keys"]
        return [label for label in {**made, **keys} if made.get(label) != keys.get(label)]
    except (FileNotFoundError, NotADirectoryError):
        return []
    except (ValueError, LookupError, TypeError, AttributeError):
        return list(keys)  # damaged, or of another version


def set_aside(out: Path) -> Path:
    """Move what a run has written into a folder of its own, in place of what lay there, and return that."""
    from mocapflow_export import layout

    former = out / FORMER
    shutil.rmtree(former, ignore_errors=True)
    former.mkdir()
    for part in layout.WRITTEN:
        if (out / part).exists():
            (out / part).rename(former / part)
    return former
