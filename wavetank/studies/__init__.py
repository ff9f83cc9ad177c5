"""Studies: runs of all combinations of settings of a case, calibration of the paddle motion, and validation of runs.

``sweep.py`` makes combinations, ``runs.py`` runs them, ``measures.py`` and ``responses.py`` evaluate runs, ``table.py``
and ``drawing.py`` write the results, ``study.py`` calls them, ``command.py`` is the command line.
``atlas.py`` has the cases of measured waves, ``validation_page.py`` writes their results.
``compare_command.py`` compares runs with measurements, ``validate.py`` gives the uncertainties.
"""
