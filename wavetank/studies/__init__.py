"""Studies: every combination of some settings of a case as a run, errors against cost, and calibration of the paddle.

``sweep.py`` makes combinations, ``runs.py`` runs them, ``measures.py`` and ``responses.py`` evaluate runs, ``table.py``
and ``drawing.py`` write the results, ``study.py`` joins them, ``command.py`` is the command line.
"""
