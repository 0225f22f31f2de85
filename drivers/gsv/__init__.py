"""ME-Systeme GSV-8 and GSV-6, multi-channel bridge amplifiers."""
