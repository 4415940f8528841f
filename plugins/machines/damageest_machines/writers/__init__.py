"""Writers, one file a control."""
