"""Finite-element blocks without physics; the only package that touches what changes between dolfinx releases."""
