"""Files in and out: mesh formats, point formats, and conversions to the objects of other libraries."""
