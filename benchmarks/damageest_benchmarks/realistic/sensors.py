"""Six sensors as published: the noise, the steps and the errors with which each scans. Lengths in mm.

Where a number is an assumption, the sensor's docstring says so.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Sensor:
    """``scale``: the multiple of their size at which the parts suit the sensor. ``distance``: from the part's middle to
    the sensor; 0: no positions, all skin is seen. ``views``: the numbers of views that its cases take in turn.
    ``options`` of the virtual scanner."""

    name: str
    scale: float
    distance: float
    views: Sequence[int]
    options: Mapping[str, Any]

    @property
    def resolution(self) -> float:
        """The standard deviation of the error of one point at ``distance``: noise, correlated error, depth step, and
        registration of its view."""
        get = self.options.get
        parts = (get("noise", 0.0), get("waviness", 0.0), get("depth_step", 0.0) / math.sqrt(12), get("misplaced", 0.0))
        return math.sqrt(sum(value**2 for value in parts))


def make_structured_light() -> Sensor:
    """A fringe projection sensor of the class of ZEISS (GOM) ATOS Core 300: 300 mm x 230 mm at 440 mm, 0.12 mm between
    points.

    Acceptance by VDI/VDE 2634 part 3 for such sensors states errors of probing, flatness and sphere spacing of 0.006,
    0.015 and 0.02 mm and less: here noise 0.006, a correlated error of 0.004 (flatness is its range, about four
    standard deviations), and views that are registered to 0.01. Noise grows with the square of the distance, since
    depth is triangulated. Assumed: 0.3 % of mixed pixels, and interreflection that lays a second sheet, 0.1 mm off,
    over 1 % of the skin (its cause: Gupta et al., Int. J. Comput. Vis. 102, 2013, 33-55).
    """
    errors = {"noise": 0.006, "noise_growth": 2, "noise_slant": 1, "noise_along": "ray", "max_incidence": 65}
    errors |= {"waviness": 0.004, "wavelength": 25.0, "misplaced": 0.01, "mixed": 0.003}
    return Sensor("structured light", 1.0, 440.0, (4, 8, 12, 2, 6), {**errors, "sheets": 0.01, "sheet_offset": 0.1})


def make_laser_line() -> Sensor:
    """A hand-guided laser line on an articulated arm, of the class of FARO Laser Line Probe HD on a Quantum arm, or
    Creaform MetraSCAN.

    The data sheet of the probe states an accuracy of 0.025 mm and a repeatability of 0.025 mm (2 sigma): noise 0.0125,
    and a correlated error of 0.01 (assumed to be within the accuracy). ISO 10360-8 errors of such arms, about 0.04 to
    0.06 mm, are errors from pass to pass: views are misplaced by 0.04. Assumed: lines 0.8 mm apart, as of a hand that
    moves by 80 mm in a second at 100 lines in a second; 170 mm to the part's middle, within the probe's depth of field
    of 115 mm behind 115 mm; 0.5 % of mixed points at edges.
    """
    errors = {"noise": 0.0125, "noise_growth": 2, "noise_slant": 1, "noise_along": "ray", "max_incidence": 70}
    errors |= {"waviness": 0.01, "wavelength": 20.0, "misplaced": 0.04, "mixed": 0.005, "stripes": 0.8}
    return Sensor("laser line", 1.0, 170.0, (6, 3, 12, 8, 4), errors)


def make_time_of_flight() -> Sensor:
    """A time-of-flight camera of the class of Microsoft Azure Kinect, NFOV unbinned, 640 x 576 pixels of 75 x 65
    degrees, at 0.9 m.

    Tölgyessy et al., Sensors 21(2), 2021, 413, confirm the maker's bounds (standard deviation at most 17 mm, error
    below 11 mm, up to 3.5 m) and measure far less at close range: here 1.5 mm of noise at 0.9 m, which grows with the
    distance. They describe flying pixels and multipath: 3 % of mixed pixels and a correlated error of 2 mm over
    150 mm, both assumed. Depth comes in whole mm. Assumed: views are registered to 2 mm. Parts are five times their
    size, 0.3 to 0.6 m.
    """
    errors = {"noise": 1.5, "noise_growth": 1, "noise_slant": 1, "noise_along": "ray", "max_incidence": 75}
    errors |= {"waviness": 2.0, "wavelength": 150.0, "misplaced": 2.0, "mixed": 0.03, "depth_step": 1.0}
    return Sensor("time of flight", 5.0, 900.0, (1, 3, 8, 2, 4), errors)


def make_stereo_camera() -> Sensor:
    """A depth camera by stereo of the class of Intel RealSense D435: 848 pixels across 90 degrees, baseline 50 mm, at
    0.6 m.

    Grunnet-Jepsen, Sweetser and Woodfill (Intel, tuning of D400 cameras): the error of depth is z² s / (f b), with
    the focal length f = 848 / (2 tan 45°) = 424 pixels, the baseline b, and an error of the disparity s of 0.08 pixels
    on skin with texture: 1.36 mm at 0.6 m. It is correlated over the window that is matched: here 1.2 mm over 20 mm
    (the window's size is assumed), and 0.6 mm of noise from point to point. The disparity is known in steps of 1 / 32
    pixel: steps of 0.53 mm, which grow with z². Assumed: 2 % of mixed pixels, views registered to 1 mm. Parts are four
    times their size, 0.25 to 0.5 m.
    """
    f, baseline, distance = 424.0, 50.0, 600.0
    step = distance**2 / 32 / (f * baseline)
    errors = {"noise": 0.6, "noise_growth": 2, "noise_slant": 1, "noise_along": "ray", "max_incidence": 70}
    errors |= {"waviness": 1.2, "wavelength": 20.0, "misplaced": 1.0, "mixed": 0.02}
    return Sensor("stereo camera", 4.0, distance, (1, 4, 2, 8, 3), {**errors, "depth_step": step, "depth_growth": 2})


def make_photogrammetry() -> Sensor:
    """Structure from motion with dense matching: a camera of 24 megapixels with a lens of 50 mm at 0.5 m, 0.04 mm on
    the part for each pixel.

    Remondino et al., Photogrammetric Record 29(146), 2014, 144-166, find noise of about one pixel on the object for
    dense matching: 0.04 mm. James and Robson, Earth Surf. Process. Landforms 39, 2014, 1413-1420, show the bowl that
    wrong calibration leaves; Luhmann et al., Close-Range Photogrammetry, give 1 : 5,000 of the object as what is
    usual: a correlated error of 0.03 mm over half of the part, the same in all images, since they are computed
    together. Assumed: a scale bar that is read to 0.05 %, and 12 % of the skin without points for want of texture.
    """
    errors = {"noise": 0.04, "noise_slant": 1, "max_incidence": 65, "waviness": 0.03, "wavelength": 60.0}
    errors |= {"waviness_shared": True, "patches": 0.12, "scale": 1.0005, "density": 0.5, "outliers": 0.001}
    return Sensor("photogrammetry", 1.0, 500.0, (12, 8, 6, 12, 10), errors)


def make_tomography() -> Sensor:
    """Industrial computed tomography with cone beam, at a voxel of 0.09 mm: a part of 130 mm on 1,500 pixels.

    Makers state MPE(SD) by VDI/VDE 2630 part 1.3 of 4.5 + L/50 µm (ZEISS METROTOM) to 9 + L/50 µm (L in mm). The skin
    is determined to about a tenth of a voxel in good conditions (VDI/VDE 2630 part 1.2): noise 0.009 mm; noise of the
    volume is smooth over two or three voxels. Assumed for metal, where beam hardening and scatter bend the skin: a
    correlated error of 0.3 voxels over four; a scale error of 0.03 % (the magnification, named in part 1.2). All skin
    is seen, that of bores too.
    """
    errors = {"noise": 0.009, "noise_along": "ray", "waviness": 0.027, "wavelength": 0.36, "scale": 1.0003}
    return Sensor("tomography", 1.0, 0.0, (0,), errors)


SENSORS: Mapping[str, Sensor] = {
    sensor.name: sensor
    for make in (
        make_structured_light,
        make_laser_line,
        make_time_of_flight,
        make_stereo_camera,
        make_photogrammetry,
        make_tomography,
    )
    for sensor in (make(),)
}
"""The sensors by name."""
