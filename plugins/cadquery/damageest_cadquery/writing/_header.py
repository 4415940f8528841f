"""Sets the header and the product data of a STEP model before it is written, so that equal shapes give equal files."""

from __future__ import annotations

from typing import Any

DATE = "1970-01-01T00:00:00"


def set_header(model: Any, name: str | None = None) -> None:
    """Sets the date of a model, and what OpenCASCADE counts up from file to file in one process.

    ``name``: of its one product; None where the products have their names already.
    """
    from OCP.APIHeaderSection import APIHeaderSection_MakeHeader
    from OCP.StepBasic import StepBasic_Product
    from OCP.StepRepr import StepRepr_NextAssemblyUsageOccurrence
    from OCP.TCollection import TCollection_HAsciiString

    APIHeaderSection_MakeHeader(model).SetTimeStamp(TCollection_HAsciiString(DATE))
    components = 0
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepBasic_Product) and name is not None:
            entity.SetId(TCollection_HAsciiString(name))
            entity.SetName(TCollection_HAsciiString(name))
        elif isinstance(entity, StepRepr_NextAssemblyUsageOccurrence):
            components += 1
            entity.SetId(TCollection_HAsciiString(str(components)))
