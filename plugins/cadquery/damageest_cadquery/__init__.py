"""Parts from STEP, IGES and BREP files, by CadQuery and OpenCASCADE."""
