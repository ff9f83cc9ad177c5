"""A numerical wave tank: fully nonlinear potential-flow water waves from Miles' variational principle on FEniCSx."""

__version__ = "0.1.0"
