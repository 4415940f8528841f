"""What an output folder says and shows: `result.json` with its schema and provenance, pictures, the window."""
