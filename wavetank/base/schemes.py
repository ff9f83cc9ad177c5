"""The registry of the integrators that a case can select."""

SCHEMES = {  # name in a case: module of wavetank/integrators, class
    "simpson-4": ("simpson", "Simpson4"),
    "third-order": ("third_order", "ThirdOrder"),
    "stormer-verlet": ("stormer_verlet", "StormerVerlet"),
    "stormer-verlet-adjoint": ("stormer_verlet", "StormerVerletAdjoint"),
    "gauss-legendre-4": ("gauss_legendre", "GaussLegendre4"),
}
