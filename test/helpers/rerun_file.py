"""A file of Rerun, read with Rerun's own reader: columns of entities over time."""

from pathlib import Path
from typing import Any

import numpy as np


class RerunFile:
    """The recording of a file, and its blueprint."""

    def __init__(self, path: Path):
        import rerun.chunk

        reader = rerun.chunk.RrdReader(str(path))
        self._chunks = list(reader.stream())
        (blueprint,) = reader.blueprints()
        self._blueprint = list(reader.stream(store=blueprint))
        (recording,) = reader.recordings()
        self.application = recording.application_id

    @property
    def entities(self) -> set[str]:
        return {str(chunk.entity_path) for chunk in self._chunks}

    @property
    def views(self) -> dict[str, str]:
        """Class of each view of the blueprint by the place that it shows."""
        found = {}
        for chunk in self._blueprint:
            row = chunk.to_record_batch().to_pylist()[0]
            if "ViewBlueprint:class_identifier" in row:
                found[row["ViewBlueprint:space_origin"][0]] = row["ViewBlueprint:class_identifier"][0]
        return found

    def static(self, entity: str, component: str) -> Any:
        """What never changes."""
        return self._rows(entity, component, True)[0][1]

    def over_time(self, entity: str, component: str) -> tuple[np.ndarray, list[Any]]:
        """Stamps, integer nanoseconds, in their order, and the values there."""
        rows = sorted(self._rows(entity, component, False), key=lambda row: row[0])
        return np.array([stamp for stamp, _ in rows], np.int64), [values for _, values in rows]

    def array(self, entity: str, component: str) -> np.ndarray:
        """Values over time as an array, of one instance without its axis."""
        return np.array(self.over_time(entity, component)[1]).squeeze(axis=1)

    def _rows(self, entity: str, component: str, static: bool) -> list[tuple[int, Any]]:
        found = []
        for chunk in self._chunks:
            if str(chunk.entity_path) == entity and chunk.is_static == static:
                batch = chunk.to_record_batch()
                if component in batch.schema.names:
                    times = [0] * len(batch) if static else batch.column("stamp").cast("int64").to_pylist()
                    found += zip(times, batch.column(component).to_pylist(), strict=True)
        assert found, f"no {component} of {entity}; there are {sorted(self.entities)}"
        return found
