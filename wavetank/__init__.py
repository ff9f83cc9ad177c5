"""A numerical wave tank: fully nonlinear potential-flow water waves from Miles' variational principle on FEniCSx."""
