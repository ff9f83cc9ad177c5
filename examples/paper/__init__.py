"""Tables and figures of the literature, recomputed with the classes that drive the tank.

[G16] is Gagarina, Ambati, Nurijanyan, van der Vegt, Bokhove, J. Comput. Phys. 306 (2016) 370-389. Each module computes
one part as rows of a table and draws it. ``integrators.py`` writes all parts on integrators.
"""
