"""The exact damage volume of a site: the part's solids cut by one surface after another, until a check passes."""
