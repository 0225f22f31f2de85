"""The Slipstand binary protocol, spoken by any microcontroller with the reference firmware."""
