"""The part's skin and the points of a scan, in a form in which thousands of poses are compared quickly."""
