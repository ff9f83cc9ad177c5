"""The integrators as the paper has them: its tables and figures recomputed on the classes that drive the tank.

[G16] is Gagarina, Ambati, Nurijanyan, van der Vegt, Bokhove, J. Comput. Phys. 306 (2016) 370-389. Each module has
one part of it: what is computed, as rows of a table, and how it is drawn. ``integrators.py`` writes all of them.
"""
