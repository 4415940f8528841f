"""What a job says about the scanner and about the temperature of the part, for the budget of uncertainty."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, Field

from damageest.job.length_error import LengthError, read_length_error
from damageest.options import Options


def _check_formula(text: str | float) -> str | float:
    read_length_error(text)
    return text


Formula = Annotated[
    Annotated[float, Field(ge=0)] | Annotated[str, Field(examples=["0.02 + L/20000"])], AfterValidator(_check_formula)
]


class Certificate(Options):
    """Figures of a certificate of acceptance or calibration, or of a data sheet. The budget names missing figures."""

    probing_form: float | None = Field(
        None, ge=0, description="probing form error, the range of distances to a fitted sphere, in the job's unit"
    )
    probing_size: float | None = Field(
        None, ge=0, description="probing size error, of the diameter of a sphere, in the job's unit"
    )
    length: Formula | None = Field(
        None, description="length measurement error: a number, or a constant plus a share of L; in the job's unit"
    )
    standard: str = Field(
        "",
        max_length=80,
        description="standard of the figures, for example ISO 10360-13, ISO 10360-8 or VDI/VDE 2634-3",
    )
    k: float | None = Field(
        None,
        gt=0,
        description="coverage factor, where the figures are expanded uncertainties (normal distribution); without it "
        "they are limits of error (rectangular distribution)",
    )

    @property
    def length_error(self) -> LengthError | None:
        """The formula, read."""
        return None if self.length is None else read_length_error(self.length)


class ScannerInfo(Options):
    """The scanner that made the scan."""

    name: str = Field("", max_length=120, description="name and serial number for the report")
    certificate: Certificate | None = Field(None, description="maximum permissible errors; default: unknown")


class Temperature(Options):
    """The temperature of the part when it was scanned: lengths are brought to 20 °C, at which drawings hold (ISO 1)."""

    part: float = Field(ge=-270, le=2000, description="temperature of the part at the scan, in °C")
    uncertainty: float | None = Field(None, ge=0, description="uncertainty of that temperature, in K; default: unknown")
    expansion: float = Field(
        ge=-1e-3, le=1e-3, description="coefficient of linear expansion of the material, in 1/K: steel about 11.5e-6"
    )
    expansion_uncertainty: float | None = Field(
        None, ge=0, le=1e-3, description="uncertainty of the coefficient, in 1/K; default: unknown"
    )
    k: float | None = Field(
        None,
        gt=0,
        description="coverage factor, where both are expanded uncertainties (normal distribution); without it they are "
        "limits (rectangular distribution)",
    )
