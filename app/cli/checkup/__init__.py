"""What `slipstand doctor` looks at; each module one side of the installation."""
