"""Parameters of version 0.1 under their present names."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .config import TrackerConfig, describe, from_dict
from .renamed import CHOICES, RENAMED, REPRESENTATIONS, flat


def migrated(values: Mapping[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """Parameters of version 0.1 under their present names, and those of modalities that they do not choose.

    Parameters
    ----------
    values : nested or dotted.

    Returns
    -------
    values, dropped : dotted name -> value; names as given that had no effect.
    """
    old = flat(values)
    if "modalities" in old:
        return old, []
    new: dict[str, Any] = {RENAMED.get(name, name): value for name, value in old.items() if name not in CHOICES}
    if new.get("chamfer.silhouette") == "plate":
        new["chamfer.silhouette"] = "background"
    engine, kind = str(old.get("engine", "contour")), str(old.get("evidence.kind", "region"))
    representation = str(old.get("color.representation", "blend"))
    colors = REPRESENTATIONS.get(representation, "color")
    if colors != "color":
        del new["color.representation"]
        new = {name.replace("color.", f"{colors}.", 1) if name.startswith("color.") else name: v for name, v in new.items()}
    contours = ["region", "chamfer"] if kind == "both" else [kind]
    modalities = [*contours, *([colors] if engine != "contour" else [])] if engine != "color" else [colors]
    choice: dict[str, Any] = {}
    if modalities != ["region"]:
        choice["modalities"] = modalities
    if engine == "color_then_contour":
        choice["combination"] = "sequential"
    known = describe(from_dict(choice)) if choice else describe(TrackerConfig())
    everything = describe()
    once = {name: name.replace(f"{colors}.", "color.", 1) for name in new}
    dropped = [name for name in new if name not in known and {name, once[name]} & everything.keys()]
    return {**choice, **{name: value for name, value in new.items() if name not in dropped}}, dropped
