"""Shared geometry: the toolbox of stages and of plugin authors.

Every function here is public. Conventions, unless a docstring says otherwise: coordinates are float64 arrays (N,3) in
the job's unit, in the frame of the caller's choice (one frame for all arguments); faces are int64 arrays (F,3),
counter-clockwise from outside; indices are int64. Inputs are never edited. What is random is seeded.
"""
