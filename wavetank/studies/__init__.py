"""Speed against accuracy, measured: every combination of some settings of a case as a run of its own.

``sweep.py`` says which combinations, ``runs.py`` runs them, ``measures.py`` judges them by an exact solution
(``exact.py``) or by another run, which ``refinement.py`` makes; ``table.py`` and ``drawing.py`` show the result;
``study.py`` puts it together, ``command.py`` is its command line.
"""
