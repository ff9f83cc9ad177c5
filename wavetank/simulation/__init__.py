"""From a scene to a run, its clock, and the time loop; what needs dolfinx is built here, by tables of nouns."""
