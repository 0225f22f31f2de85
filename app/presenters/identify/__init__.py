"""The Identify screen: a record against its simulation."""
