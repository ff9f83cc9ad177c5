"""Studies: runs of all combinations of settings of a case, errors against cost, and calibration of the paddle motion.

``sweep.py`` makes combinations, ``runs.py`` runs them, ``measures.py`` and ``responses.py`` evaluate runs, ``table.py``
and ``drawing.py`` write the results, ``study.py`` calls them, ``command.py`` is the command line.
"""
