"""The pullback test: its plan, state machine, triggers and messages to the operator."""
