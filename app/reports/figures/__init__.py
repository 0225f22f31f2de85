"""The paper's figures from runs and campaigns."""
