"""Accuracy against known truth: parts, random damages on them, scores, and the suite that brings them together."""
