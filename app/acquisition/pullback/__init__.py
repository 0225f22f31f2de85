"""The pullback test as a state machine: what is waited for, seen, and said to the operator."""
