"""What result.json says of the distances of the scan points."""

from __future__ import annotations

import numpy as np
from pydantic import Field

from damageest.artefacts import ADDED, DAMAGE, INTACT, OUTLIER, Deviation, Floats
from damageest.output.base import JsonModel

PERCENTILES = (1, 5, 25, 50, 75, 95, 99)


class LabelReport(JsonModel):
    """Number of scan points by label."""

    intact: int
    damage: int = Field(description="in a site")
    added: int = Field(description="on surplus")
    outlier: int = Field(description="in no site and on no surplus")


class DeviationReport(JsonModel):
    """Signed distances of the scan points to the part's skin, positive outside."""

    labels: LabelReport
    percentiles: dict[str, float] = Field(description="percentiles of the distance of all points, by percent")
    intact_percentiles: dict[str, float] = Field(
        description="percentiles of the distance of the intact points, by percent"
    )


def report_deviation(deviation: Deviation) -> DeviationReport:
    """Counts the points of each label and gives percentiles of their distances; none where there are no points."""
    count = {
        name: int((deviation.label == label).sum())
        for name, label in (("intact", INTACT), ("damage", DAMAGE), ("added", ADDED), ("outlier", OUTLIER))
    }
    return DeviationReport(
        labels=LabelReport(**count),
        percentiles=_give_percentiles(deviation.distance),
        intact_percentiles=_give_percentiles(deviation.distance[deviation.label == INTACT]),
    )


def _give_percentiles(distance: Floats) -> dict[str, float]:
    if not len(distance):
        return {}
    values = np.percentile(distance, PERCENTILES).tolist()
    return {str(percent): value for percent, value in zip(PERCENTILES, values, strict=True)}
