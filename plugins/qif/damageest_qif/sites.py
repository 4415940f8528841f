"""Damage sites as measured surface features: faces, volume, depth, inner surface, verdict."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from damageest.artefacts import Mesh
from damageest.findings import Interval
from damageest.geometry.distance import closest_on_mesh
from damageest.geometry.skin import find_inner_faces
from damageest.result import Result, Site
from damageest_qif.elements import Element, Lists, attributes, make, make_list, refer, write_number, write_numbers

STATUS = {"proven": "FAIL", "likely": "FAIL", "doubtful": "INDETERMINATE"}
"""A site that is lost is a deviation; of a doubtful one it is open."""


def add_site(lists: Lists, result: Result, site: Site, lost: Lost) -> None:
    """Adds a site that removes the skin ``lost``: its feature, its inner surface, and depth and area as characteristics
    with their uncertainty."""
    take = lists.numbers.take
    definition, nominal, item, measured, points = (take() for _ in range(5))
    name = f"site-{site.id}"
    lists.feature_definitions.append(make("OtherSurfaceFeatureDefinition", id=definition))
    lists.feature_nominals.append(
        make(
            "OtherSurfaceFeatureNominal",
            make("Name", text=name),
            make("FeatureDefinitionId", text=definition),
            refer("EntityExternalIds", [lists.entities[face].attrib["id"] for face in lost.faces]),
            id=nominal,
        )
    )
    lists.feature_items.append(make_item("OtherSurface", item, nominal, name))
    numbers = [("volume", site.damage.volume), *name_interval("volume", site.volume_95)]
    numbers += [("depth", site.max_depth), *name_interval("depth", site.depth_95)]
    numbers += list(zip(("centroid_x", "centroid_y", "centroid_z"), site.centroid.tolist(), strict=True))
    if site.deposit is not None:
        numbers.append(("deposit_volume", site.deposit.volume))
    texts = [
        ("verdict", site.verdict.level),
        ("accepted", "true" if site.accepted else "false"),
        ("volume_unit", f"{result.units}3"),
        *((f"reason:{one.code}", one.text) for one in site.verdict.reasons),
    ]
    has_surface = len(site.surface.faces) > 0
    lists.feature_measurements.append(
        make(
            "OtherSurfaceFeatureMeasurement",
            attributes(texts, numbers),
            make("FeatureItemId", text=item),
            make("FeatureName", text=name),
            make_list("PointList", [make("WholePointSetId", text=points)]) if has_surface else None,
            id=measured,
        )
    )
    if has_surface:
        lists.point_sets.append(_make_points(points, site.surface))
    feature = Feature(name, item, measured, STATUS[site.verdict.level])
    what = "largest depth of the loss below the nominal surface"
    add_characteristic(lists, feature, "depth", "Linear", what, site.max_depth, site.depth_95)
    add_characteristic(lists, feature, "area", "Area", "area of the nominal surface that is lost", lost.area, None)


def make_item(kind: str, number: str, nominal: str, name: str) -> Element:
    """A feature item that was measured."""
    mode = make("DeterminationMode", make("Checked", make("CheckDetails", make("Measured"))))
    return make(
        f"{kind}FeatureItem", make("FeatureNominalId", text=nominal), make("FeatureName", text=name), mode, id=number
    )


class Feature(NamedTuple):
    """A feature that was measured: its ``name``, the numbers of its ``item`` and of its measurement, and its
    ``status``."""

    name: str
    item: str
    measured: str
    status: str


def add_characteristic(
    lists: Lists, feature: Feature, quantity: str, kind: str, what: str, value: float, interval: Interval | None
) -> None:
    """Adds a measured length or area of a feature, without a tolerance. Half of the 95 % ``interval`` is its expanded
    uncertainty, so that a quarter of it is the combined one."""
    definition, nominal, of_item, number = (lists.numbers.take() for _ in range(4))
    prefix, name = f"UserDefined{kind}Characteristic", f"{feature.name} {quantity}"
    lists.definitions.append(
        make(
            f"{prefix}Definition", make("Name", text=name), make("NonTolerance", text="MEASURED"),
            make("WhatToMeasure", text=what), id=definition,
        )
    )  # fmt: skip
    lists.nominals.append(
        make(
            f"{prefix}Nominal",
            make("CharacteristicDefinitionId", text=definition),
            make("Name", text=name),
            make("TargetValue", text="0"),
            id=nominal,
        )
    )
    lists.items.append(
        make(
            f"{prefix}Item", make("Name", text=name), refer("FeatureItemIds", [feature.item]),
            make("CharacteristicNominalId", text=nominal), id=of_item,
        )
    )  # fmt: skip
    uncertain = {}
    if interval is not None and np.isfinite(interval).all():
        uncertain = {"combinedUncertainty": write_number((interval[1] - interval[0]) / 4)}
    lists.measurements.append(
        make(
            f"{prefix}Measurement",
            make("Status", make("CharacteristicStatusEnum", text=feature.status)),
            make("CharacteristicItemId", text=of_item),
            refer("FeatureMeasurementIds", [feature.measured]),
            make("Value", text=write_number(value), **uncertain),
            id=number,
        )
    )


class Lost(NamedTuple):
    """The skin that a site removes: its ``area``, and the numbers of its CAD ``faces``; none where the part is a
    mesh."""

    area: float
    faces: list[int]


def find_lost(result: Result, site: Site) -> Lost:
    lost = np.flatnonzero(~find_inner_faces(site.damage, result.part))
    area = float(site.damage.face_areas[lost].sum())
    if result.part.faces_brep is None or not len(lost):
        return Lost(area, [])
    face = closest_on_mesh(site.damage.triangles[lost].mean(axis=1), result.part).face
    return Lost(area, [int(one) for one in np.unique(result.part.faces_brep[face])])


def name_interval(name: str, interval: Interval | None) -> list[tuple[str, float]]:
    return [] if interval is None else [(f"{name}_95_low", interval[0]), (f"{name}_95_high", interval[1])]


def _make_points(number: str, surface: Mesh) -> Element:
    """The inner surface as points with facets."""
    return make(
        "MeasuredPointSet",
        make("Points", text=write_numbers(surface.vertices.ravel())),
        make("Compensated", text="true"),
        make("NumberOfFacets", text=str(len(surface.faces))),
        make("PointIndices", text=" ".join(map(str, surface.faces.ravel().tolist())), count=str(len(surface.faces))),
        count=str(len(surface.vertices)),
        id=number,
    )
