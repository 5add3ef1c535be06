"""The person of a pipeline, as long as no stage makes another body: the body that it names, its garment sewn to it."""

from __future__ import annotations

import re
from pathlib import Path

from mocapflow.assets import Body, GarmentMesh
from mocapflow.config.pipeline import Pipeline
from mocapflow.dressing.guards import body_of, mesh_of
from mocapflow.errors import GarmentError
from mocapflow.running.component_failures import naming_failures


def body_named(pipeline: Pipeline, log: Path | None) -> Body:
    """Return the body that a pipeline names; if it fails, the traceback is in `log`.

    Raises:
        MocapflowError: it can't be loaded.
    """
    with naming_failures(pipeline.body, pipeline.registry, log):
        return body_of(pipeline.body, pipeline.recording)


def sewn(pipeline: Pipeline, body: Body, log: Path | None) -> GarmentMesh | None:
    """Return the garment of a pipeline, if it has one, on a body; if it fails, the traceback is in `log`.

    Raises:
        GarmentError: it can't be sewn from these measures.
        MocapflowError: the garment failed.
    """
    if (garment := pipeline.garment) is None:
        return None
    try:
        with naming_failures(garment, pipeline.registry, log):
            return mesh_of(garment, body)
    except GarmentError as error:
        told = re.findall(r"\w+", f"{error.message} {error.hint}")  # among it the measures that may be wrong
        own = [place for setting, place in pipeline.garment_places.items() if setting in told]
        raise GarmentError(error.message, where=own[0] if own else pipeline.garment_where, hint=error.hint) from None
