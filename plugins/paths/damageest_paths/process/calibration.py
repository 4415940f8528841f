"""Width and height of a bead by the settings of the process, from beads that were laid for a trial and measured."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, TypeAdapter, ValidationError

from damageest.artefacts import Floats
from damageest.options import Options
from damageest_paths.process.channels import SPEED, Name

Size = Annotated[float, Field(gt=0, allow_inf_nan=False)]

OUTSIDE = 1e-9
"""Share by which settings are moved to the middle of all trials, so that those on their border lie within."""
MUCH_OFF = 0.1
"""Share by which a bead's section may differ from the planned one before a note says so."""


class Trial(Options):
    """A bead that was laid with some settings, and measured."""

    set: dict[Name, float] = Field(min_length=1, description="values by name, as in process; speed is the feed")
    width: Size = Field(description="width of the bead")
    height: Size = Field(description="height of the bead")


def _check_trials(trials: tuple[Trial, ...]) -> tuple[Trial, ...]:
    names = [set(trial.set) for trial in trials]
    for k, own in enumerate(names, 1):
        if own != names[0]:
            raise ValueError(
                f"row {k} sets {', '.join(sorted(own))}, row 1 {', '.join(sorted(names[0]))}: set the same"
            )
    settings = [tuple(sorted(trial.set.items())) for trial in trials]
    if len(set(settings)) < len(settings):
        raise ValueError("two rows have the same settings: give their mean")
    return trials


Trials = Annotated[tuple[Trial, ...], AfterValidator(_check_trials)]


def check_reach(trials: Sequence[Trial], settings: Mapping[str, Floats]) -> None:
    """Raises ValueError where a name that the trials set is missing in ``settings``, values (N,) by name, or a value is
    beyond the trials: nothing is known there."""
    for name in trials[0].set:
        if name not in settings:
            raise ValueError(f"the trials set {name}, which process does not: add a row for all passes")
        known, values = [trial.set[name] for trial in trials], settings[name]
        slack = 1e-9 * max(abs(value) for value in known)
        wrong = values[(values < min(known) - slack) | (values > max(known) + slack)]
        if len(wrong):
            raise ValueError(
                f"{name} {wrong[0]:g} is beyond the trials, which have {min(known):g} to {max(known):g}: lay more"
            )


def predict_beads(trials: Sequence[Trial], settings: Mapping[str, Floats]) -> Floats:
    """Width and height (N,2) of beads with ``settings``, values (N,) by name, linear between the trials.

    Raises ValueError as `check_reach`, and for settings that lie outside of the trials together.
    """
    check_reach(trials, settings)
    names = sorted(trials[0].set)
    known = np.array([[trial.set[name] for name in names] for trial in trials])
    sizes = np.array([[trial.width, trial.height] for trial in trials])
    asked = np.column_stack([settings[name] for name in names])
    low, high = known.min(axis=0), known.max(axis=0)
    varied = high > low
    if not varied.any():
        return np.tile(sizes[0], (len(asked), 1))
    known, asked = ((rows[:, varied] - low[varied]) / (high - low)[varied] for rows in (known, asked))
    if varied.sum() == 1:
        order = np.argsort(known[:, 0])
        return np.column_stack([np.interp(asked[:, 0], known[order, 0], size) for size in sizes[order].T])
    return _interpolate(known, sizes, asked, [name for name, is_varied in zip(names, varied, strict=True) if is_varied])


def _interpolate(known: Floats, sizes: Floats, asked: Floats, names: Sequence[str]) -> Floats:
    """Values (N,2) at ``asked`` (N,K), linear in the simplices between ``known`` (M,K) with ``sizes`` (M,2)."""
    from scipy.interpolate import LinearNDInterpolator
    from scipy.spatial import QhullError

    try:
        between = LinearNDInterpolator(known, sizes)
    except QhullError as error:
        raise ValueError(f"the trials do not vary {' and '.join(names)} one without the other: lay more") from error
    middle = known.mean(axis=0)
    found = np.asarray(between(middle + (1 - OUTSIDE) * (asked - middle)))
    if np.isnan(found).any():
        raise ValueError(f"settings of {' and '.join(names)} together lie outside of all trials: lay more")
    return found


def describe_beads(sizes: Floats, width: float, heights: Floats) -> list[str]:
    """Notes on beads with ``sizes`` (N,2) whose section is not that of the planned ``width`` and ``heights`` (N,)."""
    share = sizes.prod(axis=1) / (width * heights) - 1
    notes = []
    for word, k in (("more", int(share.argmax())), ("less", int(share.argmin()))):
        off = share[k] if word == "more" else -share[k]
        if off > MUCH_OFF:
            notes.append(
                f"by the trials beads are {sizes[k, 0]:.3g} wide and {sizes[k, 1]:.3g} high where {width:.3g} and "
                f"{heights[k]:.3g} are planned: {off:.0%} {word} metal; change speed, or width and height"
            )
    return notes


def complete_size(values: Any) -> Any:
    """The plain ``values`` of a job, with the width and height that the trials give for the settings of all passes,
    where the job has none. What is wrong in them is left for the check of each option to say."""
    if not isinstance(values, dict) or not values.get("calibration") or {"width", "height"} <= values.keys():
        return values
    try:
        trials = TypeAdapter(Trials).validate_python(values["calibration"])
        general = {SPEED: float(values["feed"])}
        for row in values.get("process", ()):
            general.update(row["set"] if row.keys() == {"set"} else {})
    except (ValidationError, AttributeError, KeyError, TypeError, ValueError):
        return values
    ((width, height),) = predict_beads(trials, {name: np.array([value]) for name, value in general.items()})
    return {"width": float(width), "height": float(height), **values}


def relax_size(schema: dict[str, Any]) -> None:
    """Takes width and height off what the JSON Schema of a job requires: trials give them too."""
    schema["required"] = [name for name in schema.get("required", []) if name not in ("width", "height")]
