"""Accuracy and cost against known truth: built-in parts, random damages on them, scores, and tables of the results."""
