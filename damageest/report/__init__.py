"""What a result says: `result.json` and its schema."""
