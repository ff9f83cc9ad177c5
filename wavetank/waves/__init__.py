"""Wave theories: exact and linear solutions in numpy and scipy, without finite elements."""
