"""What is recorded of a run: an observer is a schedule and an action."""
